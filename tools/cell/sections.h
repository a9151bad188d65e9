// SPDX-License-Identifier: Apache-2.0
// The sections of cell.yaml, one function each. All throw YamlError.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/yaml/strict_yaml.h"
#include "tools/cell/cell.h"

namespace silhouette {

// `path`, relative to `folder` if it is not absolute.
std::string ResolvePath(const std::filesystem::path& folder, const std::string& path);

// The robot, the configuration grid over its moving joints, and the joints that stay.
struct RobotAndGrid {
  RobotSettings robot;
  ConfigurationGrid grid;
  double grid_move = 0;  // Cell::grid_move
  std::vector<FixedJoint> fixed_joints;
  std::map<std::string, bool> joint_slides;  // Cell::joint_slides
};
// `grid`: may be left out if the robot's images are drawn.
RobotAndGrid ReadRobotAndGrid(const YamlNode& robot, const std::optional<YamlNode>& grid,
                              const std::filesystem::path& folder);

// Radians or metres of a joint. `joint`: as the model has it; null: there is no model to tell
// which.
double JointValue(const YamlNode& node, const RobotJoint* joint);

// "sim", or a map of one key that names the driver.
RobotDriver ReadRobotDriver(const YamlNode& node, const std::filesystem::path& folder);

// The key `tls` of a connection to somebody's driver.
ClientTlsFiles ReadClientTls(const YamlNode& node, const std::filesystem::path& folder);

// Where the images of the view `view` come from.
ImageSource ReadImageSource(const YamlNode& node, const std::string& view,
                            const std::filesystem::path& folder);
// "2 px": a number and its unit; a text that is anything else has no unit.
struct LengthText {
  double number = 0;
  std::string unit;
};
LengthText ReadLength(const YamlNode& node);
// "2 px", "5 cm"
Margin ReadMargin(const YamlNode& node);
Workspace ReadWorkspace(const YamlNode& node);
// `margin`: of views that state none.
std::vector<ViewSettings> ReadViews(const YamlNode& node, const Margin& margin,
                                    const std::filesystem::path& folder);
// `grid`: the joints that forbidden regions may name; `model`: of the robot; null: there is none.
CaptureSettings ReadCapture(const YamlNode& node, const ConfigurationGrid& grid,
                            const RobotModel* model);
ComparisonSettings ReadVerification(const YamlNode& node);
// `usual`: what keys that are not there mean.
SegmentationSettings ReadSegmentation(const YamlNode& node, const SegmentationSettings& usual = {});
struct PolicySettings {
  Policy policy;
  bool names_preset = false;
};
// `views`: how many there are, the bound of min_views.
PolicySettings ReadPolicy(const YamlNode& node, int views);
CalibrationSettings ReadCalibration(const YamlNode& node);
BodyGeometry ReadGeometry(const YamlNode& node);
SoundSettings ReadSound(const YamlNode& node);
SeparationCell ReadSeparation(const YamlNode& node);
ServerSettings ReadServer(const YamlNode& node, const std::filesystem::path& folder);

}  // namespace silhouette
