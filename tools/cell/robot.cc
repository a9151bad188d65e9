// SPDX-License-Identifier: Apache-2.0
// The sections `robot` and `grid` of cell.yaml: the robot, and the grid over the joints that move.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/robot/reach.h"
#include "calib/robot/robot_model.h"
#include "tools/cell/sections.h"

namespace silhouette {
namespace {

// What the section `robot` says before the grid is known.
struct RobotSection {
  RobotSettings settings;
  std::vector<GridJoint> moving;  // with one step each
  std::vector<FixedJoint> fixed;
  std::map<std::string, bool> slides;  // Cell::joint_slides
};

// The model's joint of that name; fails at `node` if there is none.
const RobotJoint& ModelJoint(const RobotModel& model, const std::string& name,
                             const YamlNode& node) {
  if (const auto index = model.JointIndex(name)) return model.joints()[*index];
  std::vector<std::string> known;
  for (const RobotJoint& joint : model.joints()) known.push_back(joint.name);
  node.Fail("the model has no moving joint '" + name + "'; " +
            (known.empty() ? "all of its joints are fixed: correct the URDF's joint types"
                           : "it has " + ListOfWords(known)));
}

// Whether a joint value has a unit of length.
bool IsLength(const YamlNode& value) {
  return value.IsScalar() && value.As<std::string>().ends_with('m');
}

// Notes in `slides` a joint without a model whose limits are lengths.
GridJoint ReadMovingJoint(const YamlNode& node, const RobotModel* model,
                          std::map<std::string, bool>& slides) {
  YamlMap map(node);
  GridJoint joint;
  joint.name = map.Get<std::string>("name");
  const RobotJoint* in_model = model ? &ModelJoint(*model, joint.name, node) : nullptr;
  const auto lower = map.Optional("lower");
  const auto upper = map.Optional("upper");
  const bool turns = in_model != nullptr && in_model->type == JointType::kContinuous;
  joint.continuous = map.Get<bool>("continuous", turns && !lower && !upper);
  map.Finish();
  if (model == nullptr && ((lower && IsLength(*lower)) || (upper && IsLength(*upper)))) {
    slides[joint.name] = true;
  }
  if (joint.continuous && in_model != nullptr && !turns) {
    node.Fail("the model says that '" + joint.name + "' is not continuous");
  }
  if (joint.continuous) {
    joint.lower = lower ? JointValue(*lower, in_model) : -std::numbers::pi;
    joint.upper = joint.lower + 2 * std::numbers::pi;
    if (upper && std::abs(JointValue(*upper, in_model) - joint.upper) > 1e-6) {
      upper->Fail("a continuous joint spans one turn; leave 'upper' out");
    }
    return joint;
  }
  if (!lower && in_model == nullptr) node.Fail("the key 'lower' is missing");
  if (!upper && in_model == nullptr) node.Fail("the key 'upper' is missing");
  joint.lower = lower ? JointValue(*lower, in_model) : in_model->lower;
  joint.upper = upper ? JointValue(*upper, in_model) : in_model->upper;
  if (in_model != nullptr && !turns &&
      (joint.lower < in_model->lower - 1e-9 || joint.upper > in_model->upper + 1e-9)) {
    node.Fail("joint '" + joint.name + "' must stay within its limits in the model, " +
              std::to_string(in_model->lower) + " to " + std::to_string(in_model->upper));
  }
  return joint;
}

std::vector<FixedJoint> ReadFixedJoints(const std::optional<YamlNode>& node, RobotSection& robot,
                                        const YamlNode& robot_node) {
  std::vector<FixedJoint> fixed;
  if (node) {
    YamlMap map(*node);
    for (const std::string& name : map.Keys()) {
      const YamlNode value = map.Required(name);
      for (const GridJoint& joint : robot.moving) {
        if (joint.name == name) value.Fail("'" + name + "' moves; it cannot be fixed, too");
      }
      const RobotJoint* const joint =
          robot.settings.model ? &ModelJoint(*robot.settings.model, name, value) : nullptr;
      const double position = JointValue(value, joint);
      if (joint == nullptr && IsLength(value)) robot.slides[name] = true;
      if (joint != nullptr && joint->type != JointType::kContinuous &&
          (position < joint->lower || position > joint->upper)) {
        value.Fail("beyond the joint's limits in the model, " + std::to_string(joint->lower) +
                   " to " + std::to_string(joint->upper));
      }
      fixed.push_back({name, position});
    }
  }
  if (!robot.settings.model) return fixed;
  std::vector<std::string> unnamed;
  for (const RobotJoint& joint : robot.settings.model->joints()) {
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

void ReadImages(const YamlNode& node, RobotSettings& robot) {
  if (!node.IsMap()) {
    if (node.AsWordOf({"captured", "drawn"}) == 1) robot.drawn = PartSettings();
    return;
  }
  PartSettings settings;
  YamlMap map(node);
  const YamlNode drawn = map.Required("drawn");
  map.Finish();
  YamlMap how(drawn);
  how.Read("tolerance", settings.tolerance, &YamlNode::AsLength);
  how.Read("geometry", settings.geometry, ReadGeometry);
  const auto arm_joints = how.Optional("arm_joints");
  how.Finish();
  robot.drawn = settings;
  if (!arm_joints) return;
  robot.arm_joints = arm_joints->As<int>();
  if (robot.arm_joints < 1) arm_joints->Fail("state at least 1, or leave it out");
}

RobotSection ReadRobot(const YamlNode& node, const std::filesystem::path& folder) {
  YamlMap map(node);
  RobotSection robot;
  map.Read("driver", robot.settings.driver,
           [&](const YamlNode& driver) { return ReadRobotDriver(driver, folder); });
  const auto urdf = map.Optional("urdf");
  std::vector<std::string> package_paths;
  if (const auto paths = map.Optional("package_paths")) {
    for (const std::string& path : paths->Values<std::string>()) {
      package_paths.push_back(ResolvePath(folder, path));
    }
  }
  map.Read("payload_radius", robot.settings.payload_radius, [](const YamlNode& radius) {
    return radius.AsLengthUpTo(3, "no tool or part reaches farther");
  });
  const auto images = map.Optional("images");
  if (images) ReadImages(*images, robot.settings);
  const YamlNode joints = map.Required("joints");
  const auto fixed = map.Optional("fixed");
  map.Finish();
  if (robot.settings.drawn && !urdf)
    images->Fail("images are drawn from the robot's model; state urdf");
  if (urdf) {
    robot.settings.urdf = ResolvePath(folder, urdf->As<std::string>());
    auto model = RobotModel::FromUrdf(robot.settings.urdf, package_paths);
    if (!model.ok()) urdf->Fail(std::string(model.status().message()));
    robot.settings.model = std::make_shared<const RobotModel>(*std::move(model));
    for (const RobotJoint& joint : robot.settings.model->joints()) {
      robot.slides[joint.name] = joint.type == JointType::kPrismatic;
    }
  }
  for (const YamlNode& joint : joints.Items()) {
    robot.moving.push_back(ReadMovingJoint(joint, robot.settings.model.get(), robot.slides));
  }
  if (robot.settings.arm_joints >= static_cast<int>(robot.moving.size())) {
    images->Fail("arm_joints is " + std::to_string(robot.settings.arm_joints) + ", and " +
                 std::to_string(robot.moving.size()) +
                 " joints move; state fewer, or leave it out");
  }
  robot.fixed = ReadFixedJoints(fixed, robot, node);
  return robot;
}

// How far each joint moves the robot's points: metres per radian or metre.
std::vector<double> Reaches(const RobotSection& robot, const YamlNode& node) {
  std::vector<std::string> moving;
  for (const GridJoint& joint : robot.moving) moving.push_back(joint.name);
  std::vector<double> reaches;
  for (const std::string& name : moving) {
    const auto reach =
        Reach(*robot.settings.model, name, moving, robot.fixed, robot.settings.payload_radius);
    if (!reach.ok()) node.Fail(std::string(reach.status().message()));
    reaches.push_back(*reach);
  }
  return reaches;
}

// Whether the joint turns all that it moves about its axis: points move along chords then. Nothing
// mimics it.
bool TurnsAll(const RobotModel& model, const std::string& joint) {
  const auto index = static_cast<int>(model.JointIndex(joint).value());
  const auto moved = [&](const RobotLink& link) { return link.joint == index; };
  return std::ranges::count_if(model.links(), moved) == 1 &&
         !std::ranges::find_if(model.links(), moved)->slides;
}

// `said`: joints that have steps, the first.
std::vector<GridJoint> StepsAsSaid(std::vector<GridJoint> joints, size_t said,
                                   const YamlNode& node) {
  YamlMap steps(node);
  const std::span<GridJoint> with_steps = std::span(joints).first(said);
  for (const GridJoint& joint : with_steps) steps.Optional(joint.name);  // all are known keys
  for (const GridJoint& joint : std::span(joints).subspan(said)) {
    const auto of_wrist = steps.Optional(joint.name);
    if (!of_wrist) continue;
    of_wrist->Fail(absl::StrCat("'", joint.name, "' is a joint of the wrist, as arm_joints is ",
                                said, ": leave it out, it has one value"));
  }
  for (GridJoint& joint : with_steps) {
    joint.steps = steps.Get<int>(joint.name);
    if (!joint.any()) continue;
    steps.Required(joint.name).Fail("one step goes with lower == upper, and only with that");
  }
  steps.Finish();
  return joints;
}

MaxMoveRule ReadRule(const std::optional<YamlNode>& node) {
  return node && node->AsWordOf({"each", "sum"}) == 1 ? MaxMoveRule::kSum : MaxMoveRule::kEach;
}

// Metres that the robot moves in a step of each joint; nothing without a model.
std::vector<double> MovesOf(const std::vector<GridJoint>& joints,
                            const std::vector<double>& reaches) {
  std::vector<double> moves;
  for (size_t j = 0; j < reaches.size(); ++j) {
    moves.push_back(joints[j].step() * reaches[j]);
  }
  return moves;
}

// The configurations of a tile are alike in what the robot sweeps between them.
ConfigurationGrid MakeGrid(std::vector<GridJoint> joints, const RobotSection& robot,
                           const YamlNode& node) {
  std::vector<double> sweeps;
  if (robot.settings.model) {
    std::vector<std::string> moving;
    std::vector<double> steps;
    for (const GridJoint& joint : joints) {
      moving.push_back(joint.name);
      steps.push_back(joint.step());
    }
    absl::StatusOr<std::vector<double>> found =
        MeanSweeps(*robot.settings.model, moving, robot.fixed, steps);
    if (!found.ok()) node.Fail(std::string(found.status().message()));
    sweeps = *std::move(found);
  }
  std::vector<int> edges = ChooseTileEdges(joints, sweeps);
  return ConfigurationGrid(std::move(joints), std::move(edges));
}

// Of a robot whose images are drawn at any configuration: its limits, and hardly a step.
ConfigurationGrid GridOfLimits(const RobotSection& robot, const YamlNode& node) {
  std::vector<GridJoint> joints = robot.moving;
  for (GridJoint& joint : joints) {
    joint.steps = joint.continuous ? 3 : joint.lower == joint.upper ? 1 : 2;
  }
  try {
    return ConfigurationGrid(std::move(joints));
  } catch (const std::invalid_argument& error) {
    node.Fail(error.what());
  }
}

}  // namespace

double JointValue(const YamlNode& node, const RobotJoint* joint) {
  if (joint != nullptr && joint->type == JointType::kPrismatic) return node.AsPosition();
  const double value = joint == nullptr ? node.AsAngleOrPosition() : node.AsAngle();
  // More radians without a unit are probably degrees.
  constexpr double kMostBare = 4 * std::numbers::pi;
  const bool has_unit = std::isalpha(static_cast<unsigned char>(node.As<std::string>().back()));
  if (!has_unit && std::abs(value) > kMostBare) {
    node.Fail("that is more than two turns; write degrees as '90 deg'" +
              std::string(joint == nullptr ? ", metres as '20 m'" : ""));
  }
  return value;
}

RobotAndGrid ReadRobotAndGrid(const YamlNode& robot_node, const std::optional<YamlNode>& grid,
                              const std::filesystem::path& folder) {
  RobotSection robot = ReadRobot(robot_node, folder);
  if (!grid) {
    if (!robot.settings.drawn) {
      robot_node.Fail("the cell needs a 'grid', unless the robot has 'images: drawn'");
    }
    if (robot.settings.arm_joints > 0) robot_node.Fail("arm_joints needs a 'grid'");
    return {robot.settings, GridOfLimits(robot, robot_node), 0, robot.fixed, robot.slides};
  }
  const YamlNode& grid_node = *grid;
  YamlMap map(grid_node);
  const auto max_move = map.Optional("max_move");
  const auto rule = map.Optional("max_move_rule");
  const auto steps = map.Optional("steps");
  map.Finish();
  if (max_move.has_value() == steps.has_value()) grid_node.Fail("say either max_move or steps");
  if (max_move && !robot.settings.model)
    max_move->Fail("max_move needs the robot's urdf; or say steps");
  if (rule && !max_move) rule->Fail("max_move_rule goes with max_move");

  std::vector<double> reaches;
  if (robot.settings.model) reaches = Reaches(robot, robot_node);
  try {
    std::vector<GridJoint> joints = robot.moving;
    const int arm_joints = robot.settings.arm_joints;
    const size_t with_steps = arm_joints > 0 ? static_cast<size_t>(arm_joints) : joints.size();
    if (max_move) {
      const double delta = DeltaPerJoint(
          max_move->AsPositiveLengthUpTo(kMostMove,
                                         "people are 0.3 to 0.5 m thick, and between grid values "
                                         "that are farther apart they are in no robot image"),
          static_cast<int>(with_steps), ReadRule(rule));
      for (size_t j = 0; j < with_steps; ++j) {
        joints[j] = TurnsAll(*robot.settings.model, joints[j].name)
                        ? MaxMoveJoint(joints[j], reaches[j], delta)
                        : MaxMoveJoint(joints[j], std::nullopt, delta / reaches[j]);
      }
    } else {
      joints = StepsAsSaid(std::move(joints), with_steps, *steps);
    }
    const std::vector<double> moves = MovesOf(joints, reaches);
    const double most = moves.empty() ? 0 : std::ranges::max(moves);
    return {robot.settings, MakeGrid(std::move(joints), robot, robot_node), most, robot.fixed,
            robot.slides};
  } catch (const std::invalid_argument& error) {
    grid_node.Fail(error.what());
  }
}

}  // namespace silhouette
