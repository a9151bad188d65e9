// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/expected_robot.h"

#include <iostream>
#include <utility>
#include <vector>

#include "calib/camera/calibration.h"
#include "calib/files/calibration_message.h"
#include "calib/robot/parts.h"
#include "calib/robot/robot_model.h"
#include "db/status/status_macros.h"

namespace silhouette {

absl::StatusOr<std::optional<DrawnRobot>> ExpectedRobotOf(const Cell& cell,
                                                          const Database& database,
                                                          std::span<const MaskSize> sizes,
                                                          const std::string& what) {
  const std::optional<DrawnRobot> none;
  if (cell.robot.model == nullptr) return none;
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto stored, snapshot.Calibration());
  if (!stored) return none;
  ASSIGN_OR_RETURN(const Calibration calibration, CalibrationFrom(*stored));
  if (calibration.cameras.empty()) return none;
  const RobotModel& robot = *cell.robot.model;
  PartSettings settings;
  settings.most_parts = 4;  // coarse is enough
  std::vector<std::string> joints;
  for (const GridJoint& joint : cell.grid.joints()) joints.push_back(joint.name);
  for (const FixedJoint& joint : cell.fixed_joints) joints.push_back(joint.name);
  // Compared with captured images by a share of pixels: the calibration's error is within it.
  auto expected = DrawnRobotOf(robot, settings, joints, {}, calibration, sizes, 0);
  if (!expected.ok()) {
    std::cerr << what << " is not checked: " << expected.status().message() << std::endl;
    return none;
  }
  return std::optional<DrawnRobot>(*std::move(expected));
}

}  // namespace silhouette
