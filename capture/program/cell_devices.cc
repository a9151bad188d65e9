#include "capture/program/cell_devices.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "capture/cell_robot.h"
#include "capture/sim/simulated_cell.h"

namespace silhouette {
namespace {

constexpr char kSim[] = "sim";

absl::Status Mistake(const Cell& cell, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat(cell.file, ": ", what));
}

absl::Status CheckSources(const Cell& cell) {
  for (const ViewSettings& view : cell.views) {
    if (view.source.empty()) {
      return Mistake(cell, absl::StrCat("the view '", view.name,
                                        "' has no source of images; put 'source: sim' into it"));
    }
    if (view.source != kSim) {
      return Mistake(cell, absl::StrCat("the view '", view.name, "' has the source '", view.source,
                                        "', which is not known; known is 'sim'"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<SimulatedCell>> LoadSimulatedCell(const Cell& cell) {
  if (cell.simulation.empty()) {
    return Mistake(cell, "the simulated cell needs the key 'simulation' with its file");
  }
  if (cell.robot.urdf.empty()) {
    return Mistake(cell, "the simulated robot needs the key 'urdf' in 'robot'");
  }
  return SimulatedCell::Load(cell.simulation, cell.robot.urdf, cell.robot.package_paths);
}

absl::StatusOr<std::unique_ptr<CameraRig>> MakeCameras(const Cell& cell,
                                                       std::shared_ptr<SimulatedCell> simulation) {
  std::vector<SimulatedView> views;
  for (const ViewSettings& view : cell.views) {
    views.push_back({view.name, view.image_width, view.image_height});
  }
  auto rig = SimulatedCameraRig::Create(std::move(simulation), views);
  if (!rig.ok()) return rig.status();
  return std::unique_ptr<CameraRig>(*std::move(rig));
}

// The simulated cell of a cell that names devices which there are.
absl::StatusOr<std::shared_ptr<SimulatedCell>> SimulationOf(const Cell& cell) {
  if (cell.robot.driver.empty()) {
    return Mistake(cell, "nobody moves the robot; put 'driver: sim' into 'robot'");
  }
  if (cell.robot.driver != kSim) {
    return Mistake(cell, absl::StrCat("the robot has the driver '", cell.robot.driver,
                                      "', which is not known; known is 'sim'"));
  }
  if (absl::Status status = CheckSources(cell); !status.ok()) return status;
  return LoadSimulatedCell(cell);
}

absl::StatusOr<CellDevices> DevicesOf(const Cell& cell, std::shared_ptr<SimulatedCell> simulation) {
  auto cameras = MakeCameras(cell, simulation);
  if (!cameras.ok()) return cameras.status();
  return CellDevices{std::make_unique<SimulatedRobot>(std::move(simulation)), *std::move(cameras)};
}

absl::Status Park(const Cell& cell, const Configuration& configuration, Robot& robot) {
  absl::StatusOr<CellRobot> cell_robot = CellRobot::Create(DescriptionOf(cell), robot);
  if (!cell_robot.ok()) return cell_robot.status();
  return cell_robot->MoveTo(configuration);
}

// Puts the robot where somebody would have driven it before a capture.
absl::Status PlaceRobot(const Cell& cell, const Travel& travel, Robot& robot) {
  for (const ConfigurationNumber number : travel.Serpentine()) {
    if (travel.Forbidden(number)) continue;
    return Park(cell, travel.grid().At(number), robot);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CellDevices> OpenDevices(const Cell& cell, const Travel& travel) {
  auto simulation = SimulationOf(cell);
  if (!simulation.ok()) return simulation.status();
  auto devices = DevicesOf(cell, *std::move(simulation));
  if (!devices.ok()) return devices.status();
  if (absl::Status status = PlaceRobot(cell, travel, *devices->robot); !status.ok()) return status;
  return devices;
}

absl::StatusOr<CellDevices> OpenDevicesForCalibration(const Cell& cell) {
  auto simulation = SimulationOf(cell);
  if (!simulation.ok()) return simulation.status();
  (*simulation)->ShowAllBoards(true);
  return DevicesOf(cell, *std::move(simulation));
}

absl::StatusOr<std::unique_ptr<CameraRig>> OpenCamerasOfEmptyCell(const Cell& cell) {
  if (absl::Status status = CheckSources(cell); !status.ok()) return status;
  auto simulation = LoadSimulatedCell(cell);
  if (!simulation.ok()) return simulation.status();
  (*simulation)->SetRobotPresent(false);
  return MakeCameras(cell, *std::move(simulation));
}

absl::StatusOr<std::unique_ptr<CameraRig>> OpenCamerasOfCell(
    const Cell& cell, bool all_boards, const std::optional<Configuration>& parked) {
  if (absl::Status status = CheckSources(cell); !status.ok()) return status;
  auto simulation = LoadSimulatedCell(cell);
  if (!simulation.ok()) return simulation.status();
  (*simulation)->ShowAllBoards(all_boards);
  if (parked) {
    SimulatedRobot robot(*simulation);
    if (absl::Status status = Park(cell, *parked, robot); !status.ok()) return status;
  }
  return MakeCameras(cell, *std::move(simulation));
}

}  // namespace silhouette
