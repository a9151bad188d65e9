#include "tools/silhouette/session.h"

#include "tools/program/program.h"

namespace silhouette {

absl::StatusOr<Client> Session::Connect() const {
  const absl::StatusOr<Client> client = Client::Connect(server, absl::Seconds(timeout));
  if (!client.ok()) return client;
  return client->WithVariant(variant);
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

void AddVariantOption(CLI::App& command, Session& session) {
  command.add_option("--variant", session.variant,
                     "The variant that is tested: with this tool, this part. Default: "
                     "that of the scene");
}

}  // namespace silhouette
