// SPDX-License-Identifier: Apache-2.0
// Where the robot must be in the images of a cell, by its model and the camera models.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

// The robot in images of `sizes`, a view each; its joints are the grid's, then the fixed ones.
// Nothing if the cell has no model of the robot, or the database no camera models; nothing, and a
// line on stderr that `what` is not checked, if it cannot be drawn.
absl::StatusOr<std::optional<DrawnRobot>> ExpectedRobotOf(const Cell& cell,
                                                          const Database& database,
                                                          std::span<const MaskSize> sizes,
                                                          const std::string& what);

}  // namespace silhouette
