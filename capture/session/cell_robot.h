// SPDX-License-Identifier: Apache-2.0
// The robot of a cell by the names of its joints: the ones of the grid move, the others stand
// fixed.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "db/mask/configuration_grid.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Joint values here are in the order of the database: grid joints, then fixed ones, each in the
// order of the cell description. The robot must outlive it.
class CellRobot {
 public:
  // InvalidArgument, naming the joint, if the cell has a joint that the robot lacks, or the other
  // way round.
  static absl::StatusOr<CellRobot> Create(const storage::v1::CellDescription& cell, Robot& robot);

  // All joint values when the grid's joints are at `configuration`.
  std::vector<double> Commanded(const Configuration& configuration) const;

  // Moves there; errors are those of Robot::MoveTo.
  absl::Status MoveTo(const Configuration& configuration);

  // Where all joints are, measured at `since` (running clock) or later; otherwise as the robot
  // reported last. Aborted if the robot moves.
  absl::StatusOr<std::vector<double>> Measure(absl::Duration since = -absl::InfiniteDuration());

  // Of the joint that deviates most: "the joint 'wrist' is at 0.31 instead of 0.25".
  std::string WhichDeviates(const std::vector<double>& commanded,
                            const std::vector<double>& measured) const;

  // The largest deviation of a joint: radians, metres. On a continuous joint of the grid full turns
  // do not count.
  double Deviation(const std::vector<double>& commanded, const std::vector<double>& measured) const;

  absl::Status Stop() { return robot_->Stop(); }

 private:
  explicit CellRobot(Robot& robot) : robot_(&robot) {}

  Robot* robot_;
  std::vector<std::string> names_;
  std::vector<bool> continuous_;  // per grid joint
  std::vector<double> fixed_;
  std::vector<size_t> place_;  // per joint of the database: its place among the robot's
};

}  // namespace silhouette
