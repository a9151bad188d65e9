// SPDX-License-Identifier: Apache-2.0
// How a client speaks to a server: in plain text, or encrypted with certificates on both sides.
#pragma once

#include <grpcpp/security/credentials.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace silhouette {

// PEM files: the authority that signed the server's certificate, and this client's own certificate
// and private key. None or all.
struct ClientTlsFiles {
  std::string ca;
  std::string certificate;
  std::string key;
};

// For `address`, "host:port" or "unix:path". The server's certificate must name the host. Files are
// read now, and again some seconds after they have changed: the next connection uses them.
// InvalidArgument: only some files are given, or the address is a Unix socket, which is not
// encrypted. NotFound: a file cannot be read.
absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> ChannelCredentialsFor(
    const std::string& address, const ClientTlsFiles& files);

}  // namespace silhouette
