// SPDX-License-Identifier: Apache-2.0
// Where the robot is in a scene, and what it covers.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "db/mask/mask.h"
#include "server/scene/joint_position.h"
#include "server/scene/scene.h"
#include "server/scene/served_database.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Of the cell: those of the grid, then the fixed ones.
std::vector<std::string> JointNames(const storage::v1::CellDescription& cell);

// What the robot covers in one view at its present configuration, which is on a grid point or
// somewhere in a grid cell, or drawn: no pixel outside `anywhere`, every pixel of `certain`.
struct RobotCover {
  Mask anywhere;
  Mask certain;
};

struct RobotInScene {
  // One per view; empty if a defect says why it is not known.
  std::vector<RobotCover> covers;
  std::vector<SceneDefect> defects;
};

// `fixed_joint_tolerance`: as in SceneSettings. InvalidArgument: a joint that the cell does not
// have, that is given twice, or whose value is not finite.
absl::StatusOr<RobotInScene> FindRobot(const ServedDatabase& database,
                                       const std::vector<JointPosition>& joints,
                                       double fixed_joint_tolerance);

}  // namespace silhouette
