// SPDX-License-Identifier: Apache-2.0
// Whether captured robot images show the robot where the cell's model and calibration have it, and
// whether views hold the whole of a drawn robot.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/joint_regions.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

// A sentence with the mend on the views in whose captured robot images the robot is elsewhere: by
// the joint values of a few configurations, and first_look: least_overlap of the cell. Empty, too,
// where nothing is known: without the robot's model, camera models or captured images with their
// joint values that are not suspect. Errors of the database.
absl::StatusOr<std::string> MisplacedViews(const Cell& cell, const Database& database);

// A sentence with the mend on the views that do not hold all that joints move of the robot, at more
// than a hundredth of the joint values of the cell outside `forbidden`. Empty: all views do, or the
// cell states a min_views that allows for it. `robot`: with the joints of the cell's grid, in its
// views.
std::string PartialViews(const Cell& cell, const DrawnRobot& robot, const JointRegions& forbidden);

}  // namespace silhouette
