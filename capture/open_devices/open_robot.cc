#include "capture/open_devices/open_robot.h"

#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "capture/drivers/feedback_robot.h"
#include "capture/drivers/simple_message_link.h"

namespace silhouette {
namespace {

MotionLimits LimitsOf(const Cell& cell, absl::Duration silence) {
  return {.joint_speed = cell.capture.joint_speed,
          .tolerance = cell.capture.joint_tolerance,
          .patience = cell.capture.arrival_timeout,
          .silence = silence};
}

template <typename Link>
absl::StatusOr<std::unique_ptr<Robot>> FeedbackRobotOf(absl::StatusOr<Link> link,
                                                       const MotionLimits& limits) {
  if (!link.ok()) {
    return absl::Status(link.status().code(), absl::StrCat("the robot: ", link.status().message()));
  }
  return std::make_unique<FeedbackRobot>(*std::move(link), limits);
}

// Opens each kind of robot.
struct Opener {
  using Result = absl::StatusOr<std::unique_ptr<Robot>>;

  const Cell& cell;
  std::shared_ptr<SimulatedCell> simulation;

  Result operator()(std::monostate) const {
    return CellMistake(cell,
                       "nobody moves the robot; put 'driver: sim' into 'robot', or the driver "
                       "of your controller");
  }
  Result operator()(const SimulatedRobotDriver&) const {
    return std::make_unique<SimulatedRobot>(simulation);
  }
  Result operator()(const SimpleMessageSettings& settings) const {
    return FeedbackRobotOf(SimpleMessageLink::Connect(settings), LimitsOf(cell, settings.timeout));
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
