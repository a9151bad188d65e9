// SPDX-License-Identifier: Apache-2.0
// Who calls.
#pragma once

#include <grpcpp/server_context.h>

#include <string>
#include <vector>

struct grpc_auth_context;

namespace silhouette {

// The names in the certificate of a connection: the common name, if it has one, then alternative
// names. Empty: there is no certificate.
std::vector<std::string> NamesOf(const grpc_auth_context* context);

// A caller for people: the first name of its certificate and its address without the port, or the
// address alone. Printable and bounded.
std::string CallerOf(grpc::CallbackServerContext& context);

}  // namespace silhouette
