// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/devices/cell_devices.h"

#include <algorithm>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "capture/session/cell_robot.h"
#include "capture/sim/obstacles.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/open_devices.h"

namespace silhouette {
namespace {

// Null if no device is simulated.
using Simulation = std::shared_ptr<SimulatedCell>;

absl::StatusOr<Simulation> SimulationOfCameras(const Cell& cell) {
  RETURN_IF_ERROR(CheckCameras(cell));
  if (!HasSimulatedCamera(cell)) return nullptr;
  return LoadSimulatedCell(cell);
}

absl::StatusOr<Simulation> SimulationOf(const Cell& cell,
                                        const std::string& variant = kBareVariant) {
  RETURN_IF_ERROR(CheckRobot(cell));
  RETURN_IF_ERROR(CheckCameras(cell));
  const bool robot = HasSimulatedRobot(cell);
  if (!robot && HasSimulatedCamera(cell)) {
    return CellMistake(cell,
                       "a view with 'source: sim' shows the simulated robot and no other; put "
                       "'driver: sim' into 'robot', or have silhouette-sim serve the cameras, too");
  }
  if (!robot) return nullptr;
  return LoadSimulatedCell(cell, variant);
}

absl::StatusOr<CellDevices> DevicesOf(const Cell& cell, const Simulation& simulation) {
  ASSIGN_OR_RETURN(auto cameras, OpenCameras(cell, simulation));
  ASSIGN_OR_RETURN(auto robot, OpenRobot(cell, simulation));
  return CellDevices{std::move(robot), std::move(cameras)};
}

absl::Status Park(const Cell& cell, const Configuration& configuration, Robot& robot) {
  ASSIGN_OR_RETURN(CellRobot cell_robot, CellRobot::Create(DescriptionOf(cell), robot));
  return cell_robot.MoveTo(configuration);
}

// Puts a simulated robot where somebody would have driven it before a capture. One whose images are
// drawn stands with its joints near 0: at their limits it may be in itself.
absl::Status PlaceRobot(const Cell& cell, const Travel& travel, const Simulation& simulation) {
  SimulatedRobot robot(simulation);
  if (cell.robot.drawn) {
    Configuration upright;
    for (const GridJoint& joint : cell.grid.joints()) {
      upright.push_back(std::clamp(0.0, joint.lower, joint.upper));
    }
    if (!travel.regions().At(upright)) return Park(cell, upright, robot);
  }
  for (const ConfigurationNumber number : travel.Serpentine()) {
    if (travel.Forbidden(number)) continue;
    return Park(cell, travel.grid().At(number), robot);
  }
  return absl::OkStatus();
}

absl::StatusOr<Simulation> PlacedSimulationOf(const Cell& cell, const Travel& travel,
                                              const std::string& variant = kBareVariant) {
  ASSIGN_OR_RETURN(const auto simulation, SimulationOf(cell, variant));
  if (simulation != nullptr) RETURN_IF_ERROR(PlaceRobot(cell, travel, simulation));
  return simulation;
}

}  // namespace

absl::StatusOr<CellDevices> OpenDevices(const Cell& cell, const Travel& travel,
                                        const std::string& variant) {
  ASSIGN_OR_RETURN(const auto simulation, PlacedSimulationOf(cell, travel, variant));
  return DevicesOf(cell, simulation);
}

absl::StatusOr<AnsweringDevices> OpenAnsweringDevices(const Cell& cell, const Travel& travel,
                                                      const std::string& variant) {
  ASSIGN_OR_RETURN(const auto simulation, PlacedSimulationOf(cell, travel, variant));
  CameraErrors errors;
  ASSIGN_OR_RETURN(auto cameras, OpenCameras(cell, simulation, &errors));
  return AnsweringDevices{.robot = OpenRobot(cell, simulation),
                          .cameras = std::move(cameras),
                          .camera_errors = std::move(errors)};
}

absl::StatusOr<CellOpeners> OpenersOf(const Cell& cell, const Travel& travel,
                                      const std::string& obstacles) {
  ASSIGN_OR_RETURN(const auto loaded, PlacedSimulationOf(cell, travel));
  const Simulation& simulation = loaded;
  if (simulation == nullptr && !obstacles.empty()) {
    return CellMistake(cell, absl::StrCat("'", obstacles,
                                          "' is of obstacles in the simulated cell, and no device "
                                          "of this cell is simulated"));
  }
  if (simulation != nullptr) {
    if (!obstacles.empty()) {
      ASSIGN_OR_RETURN(auto there, LoadObstacles(obstacles));
      simulation->SetObstacles(std::move(there));
    }
    simulation->RunInRealTime();
  }
  return CellOpeners{.robot = [cell, simulation] { return OpenRobot(cell, simulation); },
                     .cameras = [cell, simulation] { return OpenCameras(cell, simulation); }};
}

absl::StatusOr<CellDevices> OpenDevicesForCalibration(const Cell& cell) {
  ASSIGN_OR_RETURN(const auto simulation, SimulationOf(cell));
  if (simulation != nullptr) simulation->ShowAllBoards(true);
  return DevicesOf(cell, simulation);
}

absl::StatusOr<std::unique_ptr<Robot>> OpenRobotAlone(const Cell& cell) {
  RETURN_IF_ERROR(CheckRobot(cell));
  if (HasSimulatedRobot(cell)) return CellMistake(cell, "a simulated robot is in its cell only");
  return OpenRobot(cell, nullptr);
}

absl::StatusOr<std::unique_ptr<CameraSet>> OpenCamerasOfEmptyCell(const Cell& cell) {
  ASSIGN_OR_RETURN(const auto simulation, SimulationOfCameras(cell));
  if (simulation != nullptr) simulation->SetRobotPresent(false);
  return OpenCameras(cell, simulation);
}

absl::StatusOr<std::unique_ptr<CameraSet>> OpenCamerasOfCell(
    const Cell& cell, bool all_boards, const std::optional<Configuration>& parked) {
  ASSIGN_OR_RETURN(const auto simulation, SimulationOfCameras(cell));
  if (simulation != nullptr) {
    simulation->ShowAllBoards(all_boards);
    if (parked) {
      SimulatedRobot robot(simulation);
      RETURN_IF_ERROR(Park(cell, *parked, robot));
    }
  }
  return OpenCameras(cell, simulation);
}

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
  if (cell.robot.model == nullptr) {
    return CellMistake(cell, "the simulated robot needs the key 'urdf' in 'robot'");
  }
  return SimulatedCell::Load(cell.simulation, *cell.robot.model, variant);
}

absl::Status CellMistake(const Cell& cell, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(cell.file, ": ", what));
}

}  // namespace silhouette
