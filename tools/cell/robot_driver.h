// SPDX-License-Identifier: Apache-2.0
// The key `driver` in the section `robot` of cell.yaml: who moves the robot.
#pragma once

#include "capture/drivers/robots/robot_driver_settings.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {

// "sim", or a map of one key that names the driver. Throws YamlError.
RobotDriver ReadRobotDriver(const YamlNode& node);

}  // namespace silhouette
