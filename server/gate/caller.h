// SPDX-License-Identifier: Apache-2.0
// Who calls.
#pragma once

#include <grpcpp/server_context.h>
#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

struct grpc_auth_context;

namespace silhouette {

// The property of a connection's context that has a name of the user at the other end of a Unix
// socket; once for each name that has a role.
inline constexpr char kUserProperty[] = "user";

// Who is at the other end of a connection: the names in its certificate (the common name, if it has
// one, then alternative names), or the user's names that have a role. Empty: neither is known.
std::vector<std::string> NamesOf(const grpc_auth_context* context);

// The user of this machine of that name, or of the number in "uid 1234". NotFound: there is none.
absl::StatusOr<uid_t> UserNamed(const std::string& name);
// The user that has the other end of a Unix socket's connection; nothing: the system does not say.
std::optional<uid_t> UserAt(int connection);

// The first of NamesOf, in quotes; empty: there is none. Printable and bounded.
std::string QuotedNameOf(grpc::CallbackServerContext& context);

// What a log calls a caller: QuotedNameOf and its address without the port, or the address alone.
// Printable and bounded.
std::string CallerOf(grpc::CallbackServerContext& context);

}  // namespace silhouette
