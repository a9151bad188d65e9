#include "clients/program/session.h"

#include "tools/program/program.h"

namespace silhouette {

absl::StatusOr<Client> Session::Connect() const {
  return Client::Connect(server, absl::Seconds(timeout));
}

void AddServerOptions(CLI::App& program, Session& session) {
  program
      .add_option("--server", session.server, "Address of silhouette-server: host:port, unix:path")
      ->envname("SILHOUETTE_SERVER")
      ->capture_default_str();
  program.add_option("--timeout", session.timeout, "Seconds that the server may take to answer")
      ->check(PositiveNumber())
      ->capture_default_str();
}

}  // namespace silhouette
