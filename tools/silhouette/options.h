// SPDX-License-Identifier: Apache-2.0
// Options that several subcommands share: which server and how verdicts are made, a path, the form
// of output.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "silhouette/client.h"
#include "tools/program/joint_values.h"

namespace silhouette {

// What all subcommands share.
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

// --preset, --min-views, --max-occluded-views, --off-grid.
struct PolicyOptions {
  std::string preset;
  std::optional<int> min_views;
  std::optional<int> max_occluded_views;
  std::string off_grid;

  client::Policy policy() const;
};
void AddPolicyOptions(CLI::App& command, PolicyOptions& options);

// --clearance: it is measured.
void AddClearanceFlag(CLI::App& command, client::Clearance& clearance);

// --degrees.
inline AngleUnit UnitOf(bool degrees) {
  return degrees ? AngleUnit::kDegrees : AngleUnit::kRadians;
}
void AddDegreesFlag(CLI::App& command, bool& degrees);

// A path on the command line: waypoints, or --file; --degrees.
struct PathArguments {
  std::vector<std::string> waypoints;
  std::string file;
  bool degrees = false;
};
void AddPathArguments(CLI::App& command, PathArguments& arguments);
// InvalidArgument if there is none, or both.
absl::StatusOr<std::vector<Configuration>> WaypointsOf(const PathArguments& arguments);

}  // namespace silhouette
