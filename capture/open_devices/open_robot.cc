#include "capture/open_devices/open_robot.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace silhouette {

absl::Status CheckRobot(const Cell& cell) {
  if (cell.robot.driver.empty()) {
    return CellMistake(cell, "nobody moves the robot; put 'driver: sim' into 'robot'");
  }
  if (!HasSimulatedRobot(cell)) {
    return CellMistake(cell, absl::StrCat("the robot has the driver '", cell.robot.driver,
                                          "', which is not known; known is 'sim'"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Robot>> OpenRobot(const Cell& cell,
                                                 std::shared_ptr<SimulatedCell> simulation) {
  if (absl::Status status = CheckRobot(cell); !status.ok()) return status;
  return std::make_unique<SimulatedRobot>(std::move(simulation));
}

}  // namespace silhouette
