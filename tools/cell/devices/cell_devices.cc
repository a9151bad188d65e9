#include "tools/cell/devices/cell_devices.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/session/cell_robot.h"
#include "capture/sim/obstacles.h"
#include "tools/cell/devices/open_cameras.h"
#include "tools/cell/devices/open_robot.h"
#include "tools/cell/devices/simulated.h"

namespace silhouette {
namespace {

// Null if no device is simulated.
using Simulation = std::shared_ptr<SimulatedCell>;

absl::StatusOr<Simulation> SimulationOfCameras(const Cell& cell) {
  if (absl::Status status = CheckCameras(cell); !status.ok()) return status;
  if (!HasSimulatedCamera(cell)) return nullptr;
  return LoadSimulatedCell(cell);
}

absl::StatusOr<Simulation> SimulationOf(const Cell& cell, const std::string& set = kBareSet) {
  if (absl::Status status = CheckRobot(cell); !status.ok()) return status;
  if (absl::Status status = CheckCameras(cell); !status.ok()) return status;
  const bool robot = HasSimulatedRobot(cell);
  if (!robot && HasSimulatedCamera(cell)) {
    return CellMistake(cell,
                       "a view with 'source: sim' shows the simulated robot and no other; put "
                       "'driver: sim' into 'robot', or have silhouette-sim serve the cameras, too");
  }
  if (!robot) return nullptr;
  return LoadSimulatedCell(cell, set);
}

absl::StatusOr<CellDevices> DevicesOf(const Cell& cell, const Simulation& simulation) {
  auto cameras = OpenCameras(cell, simulation);
  if (!cameras.ok()) return cameras.status();
  auto robot = OpenRobot(cell, simulation);
  if (!robot.ok()) return robot.status();
  return CellDevices{*std::move(robot), *std::move(cameras)};
}

absl::Status Park(const Cell& cell, const Configuration& configuration, Robot& robot) {
  absl::StatusOr<CellRobot> cell_robot = CellRobot::Create(DescriptionOf(cell), robot);
  if (!cell_robot.ok()) return cell_robot.status();
  return cell_robot->MoveTo(configuration);
}

// Puts a simulated robot where somebody would have driven it before a capture.
absl::Status PlaceRobot(const Cell& cell, const Travel& travel, const Simulation& simulation) {
  SimulatedRobot robot(simulation);
  for (const ConfigurationNumber number : travel.Serpentine()) {
    if (travel.Forbidden(number)) continue;
    return Park(cell, travel.grid().At(number), robot);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CellDevices> OpenDevices(const Cell& cell, const Travel& travel,
                                        const std::string& set) {
  const auto simulation = SimulationOf(cell, set);
  if (!simulation.ok()) return simulation.status();
  if (*simulation != nullptr) {
    if (absl::Status status = PlaceRobot(cell, travel, *simulation); !status.ok()) return status;
  }
  return DevicesOf(cell, *simulation);
}

absl::StatusOr<CellOpeners> OpenersOf(const Cell& cell, const Travel& travel,
                                      const std::string& obstacles) {
  const auto loaded = SimulationOf(cell);
  if (!loaded.ok()) return loaded.status();
  const Simulation& simulation = *loaded;
  if (simulation == nullptr && !obstacles.empty()) {
    return CellMistake(cell, absl::StrCat("'", obstacles,
                                          "' is of obstacles in the simulated cell, and no device "
                                          "of this cell is simulated"));
  }
  if (simulation != nullptr) {
    if (absl::Status status = PlaceRobot(cell, travel, simulation); !status.ok()) return status;
    if (!obstacles.empty()) {
      auto there = LoadObstacles(obstacles);
      if (!there.ok()) return there.status();
      simulation->SetObstacles(*std::move(there));
    }
    simulation->RunInRealTime();
  }
  return CellOpeners{.robot = [cell, simulation] { return OpenRobot(cell, simulation); },
                     .cameras = [cell, simulation] { return OpenCameras(cell, simulation); }};
}

absl::StatusOr<CellDevices> OpenDevicesForCalibration(const Cell& cell) {
  const auto simulation = SimulationOf(cell);
  if (!simulation.ok()) return simulation.status();
  if (*simulation != nullptr) (*simulation)->ShowAllBoards(true);
  return DevicesOf(cell, *simulation);
}

absl::StatusOr<std::unique_ptr<CameraSet>> OpenCamerasOfEmptyCell(const Cell& cell) {
  const auto simulation = SimulationOfCameras(cell);
  if (!simulation.ok()) return simulation.status();
  if (*simulation != nullptr) (*simulation)->SetRobotPresent(false);
  return OpenCameras(cell, *simulation);
}

absl::StatusOr<std::unique_ptr<CameraSet>> OpenCamerasOfCell(
    const Cell& cell, bool all_boards, const std::optional<Configuration>& parked) {
  const auto simulation = SimulationOfCameras(cell);
  if (!simulation.ok()) return simulation.status();
  if (*simulation != nullptr) {
    (*simulation)->ShowAllBoards(all_boards);
    if (parked) {
      SimulatedRobot robot(*simulation);
      if (absl::Status status = Park(cell, *parked, robot); !status.ok()) return status;
    }
  }
  return OpenCameras(cell, *simulation);
}

}  // namespace silhouette
