// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/simulated_workplace.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/files/calibration_message.h"
#include "capture/session/capture_session.h"
#include "capture/session/reference_images.h"
#include "db/status/status_macros.h"

namespace silhouette::cell_experiment {
namespace {

constexpr char kProgram[] = "silhouette-experiments cell";

absl::Status CheckSimulated(const Cell& cell) {
  if (cell.simulation.empty() || cell.robot.model == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(
        cell.file, ": an experiment needs the simulated cell; give 'simulation' its file and ",
        "'robot' its 'urdf', as capture/sim/cells/demo/cell.yaml does"));
  }
  for (const ViewSettings& view : cell.views) {
    if (!view.ignore.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat(cell.file, ": the view '", view.name,
                       "' has pixels to ignore, which the experiment does ",
                       "not know; take 'ignore' out of it"));
    }
    if (IsSimulated(view.source)) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        cell.file, ": the view '", view.name, "' is not simulated; put 'source: sim' into it"));
  }
  return absl::OkStatus();
}

std::vector<SimulatedView> ViewsOf(const Cell& cell) {
  std::vector<SimulatedView> views;
  for (const ViewSettings& view : cell.views) {
    views.push_back({view.name, view.image_width, view.image_height});
  }
  return views;
}

absl::StatusOr<std::unique_ptr<Database>> OpenOrCreate(const std::string& path, const Cell& cell) {
  auto database = Database::Open(path, Database::Access::kWrite);
  if (absl::IsNotFound(database.status())) return Database::Create(path, DescriptionOf(cell));
  if (!database.ok()) return database.status();
  const std::vector<std::string> differences =
      Differences(DescriptionOf(cell), "the cell file", (*database)->cell(), "the database");
  if (differences.empty()) return database;
  return absl::FailedPreconditionError(absl::StrCat(
      "the database '", path, "' does not belong to the cell of '", cell.file,
      "': ", absl::StrJoin(differences, "; "), ". Name another folder with --database"));
}

}  // namespace

absl::Status CheckGridIsStated(const Cell& cell, const std::string& otherwise) {
  if (StatesAGrid(cell)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      cell.file, ": the cell states no grid of all joints that move; state one", otherwise));
}

absl::StatusOr<SimulatedWorkplace> SimulatedWorkplace::Load(const std::string& cell_file,
                                                            const std::string& database) {
  ASSIGN_OR_RETURN(Cell cell, LoadCell(cell_file, database));
  RETURN_IF_ERROR(CheckSimulated(cell));
  ASSIGN_OR_RETURN(auto simulation, SimulatedCell::Load(cell.simulation, *cell.robot.model));
  // The rig checks that every view has its camera.
  RETURN_IF_ERROR(SimulatedCameraRig::Create(simulation, ViewsOf(cell)).status());
  SimulatedWorkplace workplace(std::move(cell), std::move(simulation));
  const std::vector<SimulatedCamera>& cameras = workplace.simulation_->settings().cameras;
  for (const ViewSettings& view : workplace.cell_.views) {
    const auto camera = std::find_if(cameras.begin(), cameras.end(),
                                     [&](const auto& each) { return each.name == view.name; });
    workplace.cameras_.push_back(static_cast<size_t>(camera - cameras.begin()));
  }
  workplace.positions_.resize(workplace.robot().joints().size());
  for (const FixedJoint& joint : workplace.cell_.fixed_joints) {
    workplace.positions_[*workplace.robot().JointIndex(joint.name)] = joint.position;
  }
  for (const GridJoint& joint : workplace.cell_.grid.joints()) {
    workplace.moving_.push_back(*workplace.robot().JointIndex(joint.name));
  }
  return workplace;
}

Calibration SimulatedWorkplace::TrueCalibration() const {
  Calibration calibration;
  for (const size_t camera : cameras_) {
    calibration.cameras.push_back(simulation_->settings().cameras[camera].model);
  }
  return calibration;
}

std::vector<double> SimulatedWorkplace::Positions(std::span<const double> configuration) const {
  std::vector<double> positions = positions_;
  for (size_t j = 0; j < configuration.size(); ++j) positions[moving_[j]] = configuration[j];
  return positions;
}

absl::Status SimulatedWorkplace::TakeReferenceImages(Database& database) const {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto stored, snapshot.References());
  if (stored) return absl::OkStatus();
  ASSIGN_OR_RETURN(auto rig, SimulatedCameraRig::Create(simulation_, ViewsOf(cell_)));
  ASSIGN_OR_RETURN(auto cameras, CellCameras::Create(database.cell(), *rig, {}));
  simulation_->SetObstacles({});
  simulation_->SetRobotPresent(false);
  const auto references = TakeReferences(cameras, cell_.capture.reference_images);
  simulation_->SetRobotPresent(true);
  if (!references.ok()) return references.status();
  return database.SetReferences(*references, kProgram);
}

absl::Status SimulatedWorkplace::Capture(Database& database,
                                         const CaptureObserver& observer) const {
  ASSIGN_OR_RETURN(auto rig, SimulatedCameraRig::Create(simulation_, ViewsOf(cell_)));
  ASSIGN_OR_RETURN(const auto records, ReadRecords(database));
  const Travel travel(cell_.grid, cell_.capture.forbidden_regions);
  ASSIGN_OR_RETURN(const auto plan,
                   PlanCapture(DescriptionOf(cell_), travel, records, cell_.capture, {}));
  if (plan.captures.empty() && plan.exclusions.empty()) return absl::OkStatus();
  SimulatedRobot robot(simulation_);
  if (!plan.captures.empty()) {
    simulation_->SetPositions(Positions(cell_.grid.At(plan.captures.front())));
  }
  ASSIGN_OR_RETURN(auto session, CaptureSession::Create(database, travel, robot, *rig,
                                                        cell_.capture, cell_.segmentation));
  const CaptureReport report = session.Run(plan, kProgram, observer);
  if (!report.status.ok()) return report.status;
  if (report.stopped) {
    return absl::CancelledError(
        "stopped; what was captured is stored. Run the same command again to resume");
  }
  if (!report.complete()) {
    return absl::InternalError("not all configurations could be captured");
  }
  return absl::OkStatus();
}

absl::Status SimulatedWorkplace::Calibrate(Database& database) const {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto stored, snapshot.Calibration());
  if (stored) return absl::OkStatus();
  storage::v1::Calibration calibration;
  for (const CameraModel& camera : TrueCalibration().cameras) {
    *calibration.add_cameras() = MessageOf(camera);
  }
  return database.SetCalibration(calibration, kProgram);
}

absl::StatusOr<std::unique_ptr<Database>> SimulatedWorkplace::OpenOrCapture(
    const std::string& path, const CaptureObserver& observer) const {
  RETURN_IF_ERROR(CheckGridIsStated(cell_));
  auto database = OpenOrCreate(path, cell_);
  if (!database.ok()) return database.status();
  simulation_->SetObstacles({});
  RETURN_IF_ERROR(TakeReferenceImages(**database));
  RETURN_IF_ERROR(Capture(**database, observer));
  RETURN_IF_ERROR(Calibrate(**database));
  return database;
}

absl::StatusOr<std::unique_ptr<Database>> SimulatedWorkplace::OpenUncaptured(
    const std::string& path) const {
  ASSIGN_OR_RETURN(auto database, OpenOrCreate(path, cell_));
  RETURN_IF_ERROR(TakeReferenceImages(*database));
  RETURN_IF_ERROR(Calibrate(*database));
  return database;
}

absl::StatusOr<std::shared_ptr<const ServedDatabase>> SimulatedWorkplace::Serve(
    const Database& database, const ServeSettings& settings) const {
  TreatmentSettings treatments;
  for (const ViewSettings& view : cell_.views) {
    const Margin own = settings.margin ? Margin{.pixels = *settings.margin} : view.margin;
    treatments.views.push_back({.margin = own, .ignored = std::nullopt});
  }
  Cell cell = cell_;
  cell.robot.drawn = settings.drawn;
  ASSIGN_OR_RETURN(const auto workspace, WorkspaceOf(cell));
  treatments.workspace = workspace;
  if (settings.least_obstacle) {
    if (!cell.sound) {
      cell.sound = SoundSettings();
      cell.sound->whole_model = true;
    }
    cell.sound->least_obstacle = *settings.least_obstacle;
    cell.sound->voxel_edge.reset();
  }
  if (settings.separation) cell.separation = settings.separation;
  ASSIGN_OR_RETURN(const auto sound, SoundCellOf(cell));
  LoadSettings load{.fixed_joint_tolerance = cell.server.scene.fixed_joint_tolerance,
                    .calibration = settings.calibration};
  ASSIGN_OR_RETURN(load.forbidden, ForbiddenOf(cell));
  ASSIGN_OR_RETURN(load.drawn, DrawnCellOf(cell));
  // With the cables that the cell's own model lacks: verify-model would have found them.
  if (load.drawn) load.drawn->robot = std::make_shared<const RobotModel>(robot());
  return ServedDatabase::Load(database, cell_.calibration, treatments, sound, load);
}

}  // namespace silhouette::cell_experiment
