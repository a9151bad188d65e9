#include "clients/program/policy_options.h"

namespace silhouette {

client::Policy PolicyOptions::policy() const {
  client::Policy policy{.preset = preset,
                        .min_views = min_views,
                        .max_occluded_views = max_occluded_views,
                        .off_grid = std::nullopt};
  if (off_grid == "cell") policy.off_grid = client::OffGrid::kCell;
  if (off_grid == "nearest") policy.off_grid = client::OffGrid::kNearest;
  return policy;
}

void AddPolicyOptions(CLI::App& command, PolicyOptions& options) {
  const std::string group = "How verdicts are made (default: as the server is set)";
  command.add_option("--preset", options.preset, "uncalibrated, or paper: all views must agree")
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

}  // namespace silhouette
