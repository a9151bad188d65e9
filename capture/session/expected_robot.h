// SPDX-License-Identifier: Apache-2.0
// ExpectedRobot: where the views of a cell must see the robot, by its model and the calibration.
#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/parts.h"
#include "calib/robot/robot_model.h"
#include "db/mask/mask.h"
#include "db/store/store.h"

namespace silhouette {

// A value; used by any number of threads.
class ExpectedRobot {
 public:
  // InvalidArgument: the calibration has not a camera for each view of the cell, a joint of the
  // model is neither in the grid nor fixed, or as RobotParts::Of.
  static absl::StatusOr<ExpectedRobot> Create(const RobotModel& robot, const PartSettings& settings,
                                              const Calibration& calibration,
                                              const storage::v1::CellDescription& cell);

  // A mask a view, of the model without tolerance. `measured`: as RobotImage::measured; as many
  // values as the cell has joints, else std::invalid_argument is thrown.
  std::vector<Mask> At(std::span<const double> measured) const;

 private:
  ExpectedRobot(const RobotModel& robot, DrawnRobot drawn)
      : robot_(robot), drawn_(std::move(drawn)) {}

  RobotModel robot_;
  DrawnRobot drawn_;
  std::vector<size_t> places_;  // by joint of the model: its place in `measured`
  size_t joints_ = 0;           // of the cell
};

}  // namespace silhouette
