// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/devices/open_devices.h"

#include <algorithm>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/robot/robot_model.h"
#include "capture/drivers/grpc/grpc_robot_link.h"
#include "capture/drivers/robots/feedback_robot.h"
#include "capture/drivers/robots/manual_robot.h"
#include "capture/drivers/robots/simple_message_link.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

bool IsContinuous(const Cell& cell, const std::string& name) {
  return std::ranges::any_of(cell.grid.joints(), [&](const GridJoint& joint) {
    return joint.continuous && joint.name == name;
  });
}

// `joints`: of the robot, in its order.
MotionLimits LimitsOf(const Cell& cell, const std::vector<std::string>& joints,
                      absl::Duration silence) {
  MotionLimits limits{.joint_speed = cell.capture.joint_speed,
                      .tolerance = cell.capture.joint_tolerance,
                      .patience = cell.capture.arrival_timeout,
                      .silence = silence};
  for (const std::string& name : joints) {
    limits.continuous.push_back(IsContinuous(cell, name));
  }
  return limits;
}

template <typename Link>
absl::StatusOr<std::unique_ptr<Robot>> FeedbackRobotOf(absl::StatusOr<Link> link, const Cell& cell,
                                                       absl::Duration silence) {
  if (!link.ok()) {
    return absl::Status(link.status().code(), absl::StrCat("the robot: ", link.status().message()));
  }
  const MotionLimits limits = LimitsOf(cell, (*link)->joints(), silence);
  return std::make_unique<FeedbackRobot>(*std::move(link), limits);
}

// The joints of a robot that an operator moves: those of its model, else those in the file.
std::vector<ManualJoint> ManualJointsOf(const Cell& cell) {
  std::vector<ManualJoint> joints;
  const auto add = [&](const std::string& name) {
    const auto slides = cell.joint_slides.find(name);
    joints.push_back({.name = name,
                      .prismatic = slides != cell.joint_slides.end() && slides->second,
                      .continuous = IsContinuous(cell, name)});
  };
  if (cell.robot.model == nullptr) {
    for (const GridJoint& joint : cell.grid.joints()) add(joint.name);
    for (const FixedJoint& joint : cell.fixed_joints) add(joint.name);
    return joints;
  }
  for (const RobotJoint& joint : cell.robot.model->joints()) add(joint.name);
  return joints;
}

// Opens each kind of robot.
struct Opener {
  using Result = absl::StatusOr<std::unique_ptr<Robot>>;

  const Cell& cell;
  std::shared_ptr<SimulatedCell> simulation;

  Result operator()(std::monostate) const {
    return CellMistake(cell,
                       "no robot driver is set; put 'driver: sim' into 'robot', or the driver "
                       "of your controller");
  }
  Result operator()(const SimulatedRobotDriver&) const {
    return std::make_unique<SimulatedRobot>(simulation);
  }
  Result operator()(const SimpleMessageSettings& settings) const {
    return FeedbackRobotOf(SimpleMessageLink::Connect(settings), cell, settings.timeout);
  }
  Result operator()(const GrpcRobotSettings& settings) const {
    return FeedbackRobotOf(ConnectGrpcRobot(settings), cell, settings.timeout);
  }
  Result operator()(const ManualRobotSettings& settings) const {
    std::vector<ManualJoint> joints = ManualJointsOf(cell);
    if (std::holds_alternative<std::monostate>(settings.read)) {
      return std::make_unique<ManualRobot>(
          std::move(joints), OperatorAtTerminal(),
          settings.typed ? ManualRobot::Reading::kTyped : ManualRobot::Reading::kConfirmed);
    }
    ASSIGN_OR_RETURN(auto reader, std::visit(*this, settings.read));
    std::vector<ManualJoint> in_its_order;
    for (const std::string& name : reader->joints()) {
      const auto joint = std::find_if(joints.begin(), joints.end(),
                                      [&](const ManualJoint& known) { return known.name == name; });
      in_its_order.push_back(joint == joints.end() ? ManualJoint{.name = name} : *joint);
    }
    return std::make_unique<ManualRobot>(std::move(in_its_order), OperatorAtTerminal(),
                                         std::move(reader), cell.capture.joint_tolerance);
  }
};

}  // namespace

absl::Status CheckRobot(const Cell& cell) {
  if (!std::holds_alternative<std::monostate>(cell.robot.driver)) return absl::OkStatus();
  return Opener{.cell = cell, .simulation = nullptr}(std::monostate{}).status();
}

absl::StatusOr<std::unique_ptr<Robot>> OpenRobot(const Cell& cell,
                                                 std::shared_ptr<SimulatedCell> simulation) {
  return std::visit(Opener{.cell = cell, .simulation = std::move(simulation)}, cell.robot.driver);
}

}  // namespace silhouette
