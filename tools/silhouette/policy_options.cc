#include "tools/silhouette/policy_options.h"

namespace silhouette {

client::Policy PolicyOptions::policy() const {
  client::Policy policy;
  policy.preset = preset;
  policy.min_views = min_views;
  policy.max_occluded_views = max_occluded_views;
  if (errors_convict != 0) policy.errors_convict = errors_convict > 0;
  if (epipolar == "intersection") policy.epipolar = client::Epipolar::kIntersection;
  if (epipolar == "obstacle") policy.epipolar = client::Epipolar::kObstacle;
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
      .add_option("--epipolar", options.epipolar,
                  "Calibrated presets: where epipolar lines are searched, in what the robot covers "
                  "(intersection) or everywhere (obstacle)")
      ->check(CLI::IsMember({"intersection", "obstacle"}))
      ->group(group);
  command
      .add_flag("--errors-convict,!--no-errors-convict", options.errors_convict,
                "Calibrated presets: whether error pixels on its epipolar lines make a pixel an "
                "obstacle")
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
      "Tell, too, by how many mask pixels the robot could grow in the images before it were "
      "occupied");
}

}  // namespace silhouette
