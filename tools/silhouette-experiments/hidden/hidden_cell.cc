#include "tools/silhouette-experiments/hidden/hidden_cell.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/files/calibration_message.h"
#include "capture/segmentation/difference.h"
#include "db/status/status_macros.h"
#include "db/store/store.h"
#include "server/scene/make_scene.h"

namespace silhouette::hidden_experiment {
namespace {

constexpr double kBodyStep = 0.015;  // metres
constexpr char kProgram[] = "silhouette-experiments hidden";

cv::Mat MatOf(CameraImage& image) {
  return {image.height, image.width, image.channels == 1 ? CV_8UC1 : CV_8UC3, image.pixels.data()};
}

absl::StatusOr<std::vector<Reference>> Decoded(const storage::v1::References& stored) {
  std::vector<Reference> references;
  for (const storage::v1::Reference& view : stored.views()) {
    ASSIGN_OR_RETURN(Reference reference, Reference::FromPng(view.mean_png(), view.noise_png()));
    references.push_back(std::move(reference));
  }
  return references;
}

}  // namespace

HiddenCell::HiddenCell(Cell cell, std::shared_ptr<SimulatedCell> simulation)
    : cell_(std::move(cell)), simulation_(std::move(simulation)) {}

std::vector<JointPosition> HiddenCell::JointsAt(std::span<const double> q) const {
  std::vector<JointPosition> joints;
  for (size_t i = 0; i < q.size(); ++i) joints.push_back({cell_.grid.joints()[i].name, q[i]});
  for (const FixedJoint& joint : cell_.fixed_joints) {
    joints.push_back({joint.name, joint.position});
  }
  return joints;
}

std::vector<double> HiddenCell::PositionsAt(std::span<const double> q) const {
  std::vector<double> positions(robot().joints().size());
  for (const JointPosition& joint : JointsAt(q)) {
    positions[*robot().JointIndex(joint.name)] = joint.position;
  }
  return positions;
}

absl::StatusOr<storage::v1::References> HiddenCell::TakeReferences() {
  simulation_->SetRobotPresent(false);
  std::vector<std::vector<cv::Mat>> images(views_.size());
  for (int i = 0; i < cell_.capture.reference_images; ++i) {
    std::vector<CameraImage> taken = simulation_->TakeImages(views_);
    for (size_t view = 0; view < taken.size(); ++view) {
      images[view].push_back(MatOf(taken[view]).clone());
    }
  }
  simulation_->SetRobotPresent(true);
  storage::v1::References references;
  for (const std::vector<cv::Mat>& of_view : images) {
    const Reference reference = Reference::FromImages(of_view);
    storage::v1::Reference& stored = *references.add_views();
    stored.set_mean_png(reference.MeanPng());
    stored.set_noise_png(reference.NoisePng());
    stored.set_images(cell_.capture.reference_images);
  }
  return references;
}

std::vector<Mask> HiddenCell::TakeMasks(std::span<const double> q,
                                        std::span<const Reference> references) {
  simulation_->SetPositions(PositionsAt(q));
  std::vector<CameraImage> images = simulation_->TakeImages(views_);
  std::vector<Mask> masks;
  for (size_t view = 0; view < images.size(); ++view) {
    masks.push_back(Difference(MatOf(images[view]), references[view], cell_.segmentation,
                               cell_.views[view].mask_size));
  }
  return masks;
}

absl::StatusOr<HiddenCell> HiddenCell::Capture(const std::string& cell_file,
                                               const std::string& folder,
                                               const CaptureProgress& progress) {
  ASSIGN_OR_RETURN(Cell cell, LoadCell(cell_file));
  if (cell.simulation.empty() || !cell.sound) {
    return absl::InvalidArgumentError(
        absl::StrCat(cell_file, ": the experiment needs the keys 'simulation' and 'sound', as in ",
                     "capture/sim/cells/hidden/cell.yaml"));
  }
  ASSIGN_OR_RETURN(auto simulation,
                   SimulatedCell::Load(cell.simulation, cell.robot.urdf, cell.robot.package_paths));
  HiddenCell hidden(std::move(cell), std::move(simulation));
  storage::v1::Calibration calibration;
  const SimulationSettings& settings = hidden.simulation_->settings();
  for (const ViewSettings& view : hidden.cell_.views) {
    ASSIGN_OR_RETURN(const auto camera,
                     CameraOf(settings, {view.name, view.image_width, view.image_height}));
    hidden.views_.push_back(camera);
    const CameraModel& model = settings.cameras[camera].model;
    *calibration.add_cameras() = silhouette::MessageOf(model);
    hidden.cameras_.push_back(model.ScaledTo(view.mask_size.width, view.mask_size.height));
  }
  ASSIGN_OR_RETURN(const auto references, hidden.TakeReferences());
  ASSIGN_OR_RETURN(const auto decoded, Decoded(references));

  ASSIGN_OR_RETURN(const auto database, Database::Create(folder, DescriptionOf(hidden.cell_)));
  ASSIGN_OR_RETURN(auto writer, database->Write(kProgram));
  const ConfigurationGrid& grid = hidden.grid();
  uint64_t done = 0;
  for (ConfigurationNumber number = 0; number < grid.tiles() * kTileSize; ++number) {
    if (!grid.Contains(number)) continue;
    RobotImage image;
    image.number = number;
    image.masks = hidden.TakeMasks(grid.At(number), decoded);
    RETURN_IF_ERROR(writer.Put(image));
    if (!progress(++done, grid.size())) return absl::AbortedError("stopped");
  }
  absl::Status status = writer.Commit();
  if (status.ok()) status = database->SetReferences(references, kProgram);
  if (status.ok()) status = database->SetCalibration(calibration, kProgram);
  if (!status.ok()) return status;
  ASSIGN_OR_RETURN(const auto sound, SoundCellOf(hidden.cell_));
  ASSIGN_OR_RETURN(auto served,
                   ServedDatabase::Load(*database, hidden.cell_.calibration, {}, sound));
  hidden.database_ = std::move(served);
  hidden.body_ = std::make_unique<const RobotBody>(
      hidden.robot(), RobotBody::Settings{.range = 0.1, .step = kBodyStep});
  hidden.bodies_.resize(grid.tiles() * kTileSize);
  for (ConfigurationNumber number = 0; number < hidden.bodies_.size(); ++number) {
    if (!grid.Contains(number)) continue;
    hidden.bodies_[number] = hidden.body_->At(hidden.PositionsAt(grid.At(number)));
  }
  return hidden;
}

Served HiddenCell::SceneAt(std::span<const double> q, std::vector<Obstacle> obstacles) {
  simulation_->SetObstacles(std::move(obstacles));
  simulation_->SetPositions(PositionsAt(q));
  std::vector<CameraImage> images = simulation_->TakeImages(views_);
  SceneInput input{.joints = JointsAt(q), .views = {}};
  for (size_t view = 0; view < images.size(); ++view) {
    input.views.push_back(
        {cell_.views[view].name, std::nullopt,
         SceneMask{Difference(MatOf(images[view]), database_->reference(static_cast<int>(view)),
                              cell_.segmentation, cell_.views[view].mask_size)}});
  }
  simulation_->SetObstacles({});
  const Moment now = SystemClock();
  Scene scene = MakeScene(*database_, input, SceneSettings{.max_age = absl::InfiniteDuration()},
                          cell_.segmentation, now)
                    .value();
  return {database_, std::make_shared<const Scene>(std::move(scene)), Reason::kNone};
}

}  // namespace silhouette::hidden_experiment
