// SPDX-License-Identifier: Apache-2.0
// The server's gate: TLS with certificates on both sides, or the users at the other end of a Unix
// socket, and who may call what.
//
// Certificates are read again with the first connection after a file has changed. Connections that
// exist stay as they are. Files that do not fit together, or are not valid yet, are reported in the
// log and read again with the next connection; the former ones stay in use.
#pragma once

#include <grpcpp/security/server_credentials.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/gate/gate_settings.h"

namespace silhouette {

// Called when a call was denied, with the caller's name (quoted, printable), the call (a known one,
// or "unknown call") from any thread; must not block.
using Denied = std::function<void(const std::string& caller, const std::string& call)>;

// The files' text.
struct TlsTexts {
  std::string certificate;
  std::string key;
  std::string client_ca;
  absl::Time valid_until;  // of the server's certificate
};

// Reads the files. NotFound: one cannot be read. FailedPrecondition: it is no certificate or key,
// key and certificate do not belong together, or the certificate is not valid now. The message
// names the file.
absl::StatusOr<TlsTexts> ReadTls(const TlsFiles& files);

// Whether all addresses of "host:port" are of the loopback interface. False if there is none.
bool StaysOnThisMachine(const std::string& address);

// Whether a server may listen on `address` ("host:port" or "unix:path") with these settings.
// FailedPrecondition: it would speak plain text beyond this machine without settings.insecure.
// InvalidArgument: settings that do not go together.
absl::Status CheckGate(const std::string& address, const GateSettings& settings);

// What a server takes connections with. Calls that settings.roles does not permit end with
// PERMISSION_DENIED before any service has them. `user`: all names that settings.roles have for the
// user at the other end of a Unix socket; empty: it has none, or there is no user. Errors: those of
// ReadTls.
absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> CredentialsFor(
    const GateSettings& settings, const std::vector<std::string>& user, Denied denied);

// Gives the socket file of "unix:path" its group and mode; without socket_mode 0660.
// FailedPrecondition: there is no such group, or this process may not give it.
absl::Status GuardSocket(const std::string& address, const GateSettings& settings);

}  // namespace silhouette
