// SPDX-License-Identifier: Apache-2.0
// The section `grid` of cell.yaml: the grid over the joints that move.
#include <optional>
#include <utility>

#include "calib/robot/reach.h"
#include "tools/cell/robot.h"
#include "tools/cell/sections.h"

namespace silhouette {
namespace {

// How far each joint moves the robot's points: metres per radian; nothing for prismatic joints,
// whose metres are the robot's.
std::vector<std::optional<double>> Reaches(const RobotSection& robot, const YamlNode& node) {
  std::vector<std::string> moving;
  for (const GridJoint& joint : robot.moving) moving.push_back(joint.name);
  std::vector<std::optional<double>> reaches;
  for (const std::string& name : moving) {
    if (ModelJoint(*robot.model, name, node).type == JointType::kPrismatic) {
      reaches.emplace_back();
      continue;
    }
    const auto reach =
        Reach(*robot.model, name, moving, robot.fixed, robot.settings.payload_radius);
    if (!reach.ok()) node.Fail(std::string(reach.status().message()));
    reaches.emplace_back(*reach);
  }
  return reaches;
}

std::vector<GridJoint> StepsAsSaid(std::vector<GridJoint> joints, const YamlNode& node) {
  YamlMap steps(node);
  for (const GridJoint& joint : joints) steps.Optional(joint.name);  // all are known keys
  for (GridJoint& joint : joints) joint.steps = steps.Get<int>(joint.name);
  steps.Finish();
  return joints;
}

MaxMoveRule ReadRule(const std::optional<YamlNode>& node) {
  if (!node) return MaxMoveRule::kEach;
  const std::string rule = node->As<std::string>();
  if (rule != "each" && rule != "sum") node->Fail("'each' or 'sum' is expected");
  return rule == "sum" ? MaxMoveRule::kSum : MaxMoveRule::kEach;
}

// The grid's tiles are even in the metres that the robot moves, where a model tells them.
ConfigurationGrid MakeGrid(std::vector<GridJoint> joints,
                           const std::vector<std::optional<double>>& reaches) {
  std::vector<double> extents;
  for (size_t j = 0; j < reaches.size(); ++j) {
    const double metres = joints[j].step() * reaches[j].value_or(1);
    extents.push_back(metres > 0 ? metres : 1);
  }
  std::vector<int> edges = ChooseTileEdges(joints, extents);
  return ConfigurationGrid(std::move(joints), std::move(edges));
}

}  // namespace

RobotAndGrid ReadRobotAndGrid(const YamlNode& robot_node, const YamlNode& grid_node,
                              const std::filesystem::path& folder) {
  RobotSection robot = ReadRobot(robot_node, folder);
  YamlMap map(grid_node);
  const auto max_move = map.Optional("max_move");
  const auto rule = map.Optional("max_move_rule");
  const auto steps = map.Optional("steps");
  map.Finish();
  if (max_move.has_value() == steps.has_value()) grid_node.Fail("say either max_move or steps");
  if (max_move && !robot.model) max_move->Fail("max_move needs the robot's urdf; or say steps");
  if (rule && !max_move) rule->Fail("max_move_rule goes with max_move");

  std::vector<std::optional<double>> reaches;
  if (robot.model) reaches = Reaches(robot, robot_node);
  try {
    std::vector<GridJoint> joints = robot.moving;
    if (max_move) {
      const double delta =
          DeltaPerJoint(max_move->As<double>(), static_cast<int>(joints.size()), ReadRule(rule));
      for (size_t j = 0; j < joints.size(); ++j) {
        joints[j] = MaxMoveJoint(joints[j], reaches[j], delta);
      }
    } else {
      joints = StepsAsSaid(std::move(joints), *steps);
    }
    return {robot.settings, MakeGrid(std::move(joints), reaches), robot.fixed};
  } catch (const std::invalid_argument& error) {
    grid_node.Fail(error.what());
  }
}

}  // namespace silhouette
