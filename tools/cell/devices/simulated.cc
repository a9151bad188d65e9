#include "tools/cell/devices/simulated.h"

#include <algorithm>
#include <string>
#include <variant>

#include "absl/strings/str_cat.h"

namespace silhouette {

bool HasSimulatedRobot(const Cell& cell) {
  return std::holds_alternative<SimulatedRobotDriver>(cell.robot.driver);
}

bool HasSimulatedCamera(const Cell& cell) {
  return std::any_of(cell.views.begin(), cell.views.end(),
                     [](const ViewSettings& view) { return IsSimulated(view.source); });
}

absl::StatusOr<std::shared_ptr<SimulatedCell>> LoadSimulatedCell(const Cell& cell,
                                                                 const std::string& variant) {
  if (cell.simulation.empty()) {
    return CellMistake(cell, "the simulated cell needs the key 'simulation' with its file");
  }
  if (cell.robot.urdf.empty()) {
    return CellMistake(cell, "the simulated robot needs the key 'urdf' in 'robot'");
  }
  return SimulatedCell::Load(cell.simulation, cell.robot.urdf, cell.robot.package_paths, variant);
}

absl::Status CellMistake(const Cell& cell, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(cell.file, ": ", what));
}

}  // namespace silhouette
