// SPDX-License-Identifier: Apache-2.0
// How a client speaks to a server: in plain text, or encrypted with certificates on both sides.
#pragma once

#include <grpcpp/security/credentials.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "proto/tls/client_tls_files.h"

namespace silhouette {

// For `address`, "host:port" or "unix:path". The server's certificate must name the host. Files are
// read now, and again some seconds after they have changed: the next connection uses them.
// InvalidArgument: only some files are given, or the address is a Unix socket, which is not
// encrypted. NotFound: a file cannot be read.
absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> ChannelCredentialsFor(
    const std::string& address, const ClientTlsFiles& files);

}  // namespace silhouette
