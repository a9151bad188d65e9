// SPDX-License-Identifier: Apache-2.0
// Whether two cameras stand where the calibration has each other.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/devices/devices.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

// One sentence for each pair of views in which the robot is where the model has it in the other
// view, and not where it has it in the view itself. One image of each camera is compared with the
// reference images. None: it is not so, or cannot be seen, as without reference images or camera
// models, or where the robot looks alike in both. Errors of devices and of the database.
absl::StatusOr<std::vector<std::string>> ExchangedViews(const Cell& cell, const Database& database,
                                                        Robot& robot, CameraRig& cameras);

}  // namespace silhouette
