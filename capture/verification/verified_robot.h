// SPDX-License-Identifier: Apache-2.0
// The robot of a cell whose robot images are drawn, with what its verification adds.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/drawn_cell.h"
#include "db/mask/configuration_grid.h"
#include "db/store/store.h"

namespace silhouette {

// The robot as the model has it, tolerance and payload added, nothing else: what a verification is
// of. Its joints are those of the database's grid. `margin`: the calibration's, mask pixels.
// FailedPrecondition: the calibration has no camera models. Else the errors of DrawnRobotOf.
absl::StatusOr<DrawnRobot> BareRobotOf(const DrawnCell& cell, const Database& database,
                                       const std::optional<Calibration>& calibration,
                                       double margin);

struct VerifiedRobot {
  DrawnRobot robot;
  // Why the model is not verified, as a sentence that begins with a small letter; empty: it is, and
  // the robot has the growth of its links.
  std::string unverified;
  // Metres, by link of the model; empty if it is not verified.
  std::vector<double> growth = {};
};

// `joints`: the ranges in which the robot is drawn, by joint of `bare`. It is not verified where
// one is wider than in the verification. InvalidArgument: the verification is of this robot, and
// its growth is none.
absl::StatusOr<VerifiedRobot> VerifiedRobotOf(
    const DrawnCell& cell, DrawnRobot bare, std::span<const GridJoint> joints,
    const std::optional<storage::v1::ModelVerification>& verification);

}  // namespace silhouette
