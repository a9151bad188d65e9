// SPDX-License-Identifier: Apache-2.0
// The verdicts on any configuration of a drawn robot, from the obstacle planes of one scene: what
// the server finds under a preset that counts views.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/drawing/drawn_checker.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "clients/cpp/space_map.h"
#include "db/mask/joint_regions.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/space_snapshot.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette::client {

// What a stream sends once for each database.
struct ServedRobot {
  std::shared_ptr<const DrawnRobot> robot;
  ConfigurationGrid grid;
  JointRegions forbidden;
  std::vector<std::string> views;  // names
};

// Internal, with the fault, if the message is malformed or does not fit the grid.
absl::StatusOr<std::shared_ptr<const ServedRobot>> FromMessage(const v1::DrawnRobot& message,
                                                               const ConfigurationGrid& grid);

// Immutable; any number of threads may read it.
class DrawnSpace {
 public:
  // By the planes of an update. Internal, with the fault, if they are malformed or not those of the
  // robot's views.
  static absl::StatusOr<std::shared_ptr<const DrawnSpace>> FromMessage(
      std::shared_ptr<const ServedRobot> robot, const v1::WatchConfigurationSpaceResponse& update);

  // Without evidence, hidden_possible and regions. `map`: of the same scene: where a node of the
  // arm (GridJoint::any) is free, so are all joint values whose nearest node it is.
  Verdict Check(std::span<const double> q, const SpaceMap& map) const;
  // As SpaceSnapshot::CheckMotion, which bounds `path_resolution`.
  MotionVerdict CheckMotion(std::span<const double> from, std::span<const double> to,
                            double path_resolution) const;

 private:
  DrawnSpace(std::shared_ptr<const ServedRobot> robot, std::vector<std::optional<Mask>> planes,
             int min_views);

  // The robot at `q`, grown; nothing between `from` and `to` may be forbidden.
  Verdict Judge(std::span<const double> q, Growth growth, std::span<const double> from,
                std::span<const double> to) const;
  bool IsOutside(std::span<const double> q) const;
  bool FreeByNode(std::span<const double> q, const SpaceMap& map) const;

  std::shared_ptr<const ServedRobot> robot_;
  bool view_missing_ = false;
  int min_views_ = 1;
  DrawnChecker checker_;
};

}  // namespace silhouette::client
