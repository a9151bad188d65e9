// What all subcommands share: which server, how long to wait, which form of output.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "absl/status/statusor.h"
#include "silhouette/client.h"

namespace silhouette {

struct Session {
  std::string server = client::kDefaultAddress;
  double timeout = 10;  // seconds for each call
  std::string format = "text";
  std::string variant;  // of robot images; empty: none is named

  bool json() const { return format == "json"; }
  absl::StatusOr<Client> Connect() const;
};

// --server (or the environment's SILHOUETTE_SERVER) and --timeout.
void AddServerOptions(CLI::App& program, Session& session);

// --variant, of a subcommand that asks for verdicts.
void AddVariantOption(CLI::App& command, Session& session);

}  // namespace silhouette
