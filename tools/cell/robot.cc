// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/robot.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "tools/cell/robot_driver.h"

namespace silhouette {
namespace {

GridJoint ReadMovingJoint(const YamlNode& node, const std::optional<RobotModel>& model) {
  YamlMap map(node);
  GridJoint joint;
  joint.name = map.Get<std::string>("name");
  const RobotJoint* in_model = model ? &ModelJoint(*model, joint.name, node) : nullptr;
  const auto lower = map.Optional("lower");
  const auto upper = map.Optional("upper");
  const bool turns = in_model != nullptr && in_model->type == JointType::kContinuous;
  joint.continuous = map.Get<bool>("continuous", turns && !lower && !upper);
  map.Finish();
  if (joint.continuous && in_model != nullptr && !turns) {
    node.Fail("the model says that '" + joint.name + "' is not continuous");
  }
  if (joint.continuous) {
    joint.lower = lower ? lower->AsAngle() : -std::numbers::pi;
    joint.upper = joint.lower + 2 * std::numbers::pi;
    if (upper && std::abs(upper->AsAngle() - joint.upper) > 1e-6) {
      upper->Fail("a continuous joint spans one turn; leave 'upper' out");
    }
    return joint;
  }
  if (!lower && in_model == nullptr) node.Fail("the key 'lower' is missing");
  if (!upper && in_model == nullptr) node.Fail("the key 'upper' is missing");
  joint.lower = lower ? lower->AsAngle() : in_model->lower;
  joint.upper = upper ? upper->AsAngle() : in_model->upper;
  if (in_model != nullptr && !turns &&
      (joint.lower < in_model->lower - 1e-9 || joint.upper > in_model->upper + 1e-9)) {
    node.Fail("joint '" + joint.name + "' must stay within its limits in the model, " +
              std::to_string(in_model->lower) + " to " + std::to_string(in_model->upper));
  }
  return joint;
}

std::vector<FixedJoint> ReadFixedJoints(const std::optional<YamlNode>& node,
                                        const RobotSection& robot, const YamlNode& robot_node) {
  std::vector<FixedJoint> fixed;
  if (node) {
    YamlMap map(*node);
    for (const std::string& name : map.Keys()) {
      const YamlNode value = map.Required(name);
      for (const GridJoint& joint : robot.moving) {
        if (joint.name == name) value.Fail("'" + name + "' moves; it cannot be fixed, too");
      }
      const double position = value.AsAngle();
      if (robot.model) {
        const RobotJoint& joint = ModelJoint(*robot.model, name, value);
        if (joint.type != JointType::kContinuous &&
            (position < joint.lower || position > joint.upper)) {
          value.Fail("beyond the joint's limits in the model, " + std::to_string(joint.lower) +
                     " to " + std::to_string(joint.upper));
        }
      }
      fixed.push_back({name, position});
    }
  }
  if (!robot.model) return fixed;
  std::vector<std::string> unnamed;
  for (const RobotJoint& joint : robot.model->joints()) {
    const auto named = [&](const auto& other) { return other.name == joint.name; };
    if (std::none_of(robot.moving.begin(), robot.moving.end(), named) &&
        std::none_of(fixed.begin(), fixed.end(), named)) {
      unnamed.push_back(joint.name);
    }
  }
  if (!unnamed.empty()) {
    robot_node.Fail("in 'fixed', say where " + ListOfWords(unnamed) + " stand" +
                    (unnamed.size() == 1 ? "s" : ""));
  }
  return fixed;
}

}  // namespace

RobotSection ReadRobot(const YamlNode& node, const std::filesystem::path& folder) {
  YamlMap map(node);
  RobotSection robot;
  if (const auto driver = map.Optional("driver")) robot.settings.driver = ReadRobotDriver(*driver);
  const auto urdf = map.Optional("urdf");
  if (const auto paths = map.Optional("package_paths")) {
    for (const std::string& path : paths->Values<std::string>()) {
      robot.settings.package_paths.push_back(ResolvePath(folder, path));
    }
  }
  if (const auto radius = map.Optional("payload_radius")) {
    robot.settings.payload_radius = radius->As<double>();
    if (robot.settings.payload_radius < 0) radius->Fail("a length not below 0 is expected");
  }
  const YamlNode joints = map.Required("joints");
  const auto fixed = map.Optional("fixed");
  map.Finish();
  if (urdf) {
    robot.settings.urdf = ResolvePath(folder, urdf->As<std::string>());
    auto model = RobotModel::FromUrdf(robot.settings.urdf, robot.settings.package_paths);
    if (!model.ok()) urdf->Fail(std::string(model.status().message()));
    robot.model = *std::move(model);
  }
  for (const YamlNode& joint : joints.Items()) {
    robot.moving.push_back(ReadMovingJoint(joint, robot.model));
  }
  robot.fixed = ReadFixedJoints(fixed, robot, node);
  return robot;
}

const RobotJoint& ModelJoint(const RobotModel& model, const std::string& name,
                             const YamlNode& node) {
  if (const auto index = model.JointIndex(name)) return model.joints()[*index];
  std::vector<std::string> known;
  for (const RobotJoint& joint : model.joints()) known.push_back(joint.name);
  node.Fail("the model has no moving joint '" + name + "'; it has " + ListOfWords(known));
}

}  // namespace silhouette
