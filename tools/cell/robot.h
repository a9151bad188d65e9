// SPDX-License-Identifier: Apache-2.0
// The section `robot` of cell.yaml, for the section `grid` that rests on it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/robot/robot_model.h"
#include "tools/cell/sections.h"

namespace silhouette {

// What the section `robot` says before the grid is known.
struct RobotSection {
  RobotSettings settings;
  std::optional<RobotModel> model;
  std::vector<GridJoint> moving;  // with one step each
  std::vector<FixedJoint> fixed;
};

// Throws YamlError.
RobotSection ReadRobot(const YamlNode& node, const std::filesystem::path& folder);

// The model's joint of that name; fails at `node` if there is none.
const RobotJoint& ModelJoint(const RobotModel& model, const std::string& name,
                             const YamlNode& node);

}  // namespace silhouette
