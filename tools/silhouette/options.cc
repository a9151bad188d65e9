// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/options.h"

#include "tools/program/program.h"
#include "tools/silhouette/formats/inputs.h"

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

client::Policy PolicyOptions::policy() const {
  client::Policy policy;
  policy.preset = preset;
  policy.min_views = min_views;
  policy.max_occluded_views = max_occluded_views;
  if (off_grid == "cell") policy.off_grid = client::OffGrid::kCell;
  if (off_grid == "nearest") policy.off_grid = client::OffGrid::kNearest;
  return policy;
}

void AddPolicyOptions(CLI::App& command, PolicyOptions& options) {
  const std::string group = "How verdicts are made (default: as the server is set)";
  command
      .add_option("--preset", options.preset,
                  "uncalibrated; paper: all views must agree; where the cell is calibrated also "
                  "calibrated, paper-calibrated; where its file has 'sound' also sound-planes, "
                  "sound")
      ->group(group);
  command
      .add_option("--min-views", options.min_views,
                  "Occupied if at least this many views show an obstacle")
      ->group(group);
  command
      .add_option("--max-occluded-views", options.max_occluded_views,
                  "In how many views the robot may hide an obstacle")
      ->group(group);
  command
      .add_option("--off-grid", options.off_grid,
                  "What stands for a configuration off the grid: cell or nearest")
      ->check(CLI::IsMember({"cell", "nearest"}))
      ->group(group);
}

void AddClearanceFlag(CLI::App& command, client::Clearance& clearance) {
  command.add_flag_callback(
      "--clearance", [&clearance] { clearance = client::Clearance::kMeasure; },
      "Also report the clearance in mask pixels: how far the robot could grow in the images and "
      "still be free");
}

void AddDegreesFlag(CLI::App& command, bool& degrees) {
  command.add_flag("--degrees", degrees, "Values without a unit are degrees");
}

void AddPathArguments(CLI::App& command, PathArguments& arguments) {
  command.add_option("waypoints", arguments.waypoints,
                     "Configurations: joint values with commas between them");
  command.add_option("--file", arguments.file,
                     "A JSON file with configurations under the key \"waypoints\", as plan writes "
                     "it; -: stdin");
  AddDegreesFlag(command, arguments.degrees);
}

absl::StatusOr<std::vector<Configuration>> WaypointsOf(const PathArguments& arguments) {
  if (arguments.waypoints.empty() == arguments.file.empty()) {
    return absl::InvalidArgumentError(
        "give waypoints, e.g. 0.1,0.2 0.3,0.2, or a path with --file FILE, and not both");
  }
  if (!arguments.file.empty()) return ReadWaypoints(arguments.file);
  std::vector<Configuration> waypoints;
  for (const std::string& text : arguments.waypoints) {
    waypoints.push_back(ParseConfiguration(text, UnitOf(arguments.degrees)));
  }
  return waypoints;
}

}  // namespace silhouette
