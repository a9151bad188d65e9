#include "tools/silhouette-calibrate/run_lenses.h"

#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-calibrate/camera_files.h"
#include "tools/silhouette-calibrate/run_tags.h"

namespace silhouette {

namespace {

absl::StatusOr<LensSolution> RunLensesSolve(const Cell& cell, const SessionSettings& settings,
                                            const SessionRecord& record) {
  std::vector<LensCamera> cameras;
  for (const ViewSettings& view : cell.views) {
    cameras.push_back({.name = view.name, .width = view.image_width, .height = view.image_height});
  }
  absl::StatusOr<LensSolution> solution = SolveLenses(cameras, settings.boards, record.sightings);
  if (solution.ok()) return solution;
  return absl::Status(solution.status().code(),
                      absl::StrCat("the lenses: ", solution.status().message()));
}

}  // namespace

std::string LensFolder(const std::string& session) {
  return (std::filesystem::path(session) / "lenses").string();
}

absl::StatusOr<FoundLenses> FindLenses(const Cell& cell, const RobotModel& robot,
                                       const SessionSettings& settings, SessionRecord& record) {
  absl::StatusOr<LensSolution> solution = RunLensesSolve(cell, settings, record);
  if (!solution.ok()) return solution.status();
  std::vector<std::string> views;
  std::vector<CameraIntrinsics> lenses;
  for (const SolvedCamera& camera : solution->cameras) {
    views.push_back(camera.name);
    lenses.push_back(camera.model->intrinsics());
  }
  ASSIGN_OR_RETURN(auto better,
                   DetectAgain(settings.folder, record.frames, views, lenses, settings.boards));
  record.sightings = std::move(better);
  RETURN_IF_ERROR(WriteRecord(settings.folder, robot, record));
  solution = RunLensesSolve(cell, settings, record);
  if (!solution.ok()) return solution.status();
  // That no board ties cameras together is no matter: the robot does.
  if (solution->groups.size() > 1) solution->warnings.pop_back();
  FoundLenses found{.solution = *std::move(solution), .files = {}};
  for (const SolvedCamera& camera : found.solution.cameras) {
    ASSIGN_OR_RETURN(const auto written,
                     WriteCameraFile(LensFolder(settings.folder), camera.name, *camera.model));
    found.files.push_back(written);
  }
  return found;
}

storage::v1::CalibrationRecord RecordOf(const LensSolution& solution) {
  storage::v1::CalibrationRecord record;
  for (const SolvedCamera& camera : solution.cameras) {
    const auto add = [&](const char* name, double value, const char* unit) {
      storage::v1::CalibrationFigure& figure = *record.add_figures();
      figure.set_name(name);
      figure.set_of(camera.name);
      figure.set_value(value);
      figure.set_unit(unit);
    };
    add("lens_images", camera.images, "");
    add("lens_centre_sigma", camera.centre_sigma, "px");
    add("lens_rim_sigma", camera.edge_sigma, "px");
  }
  for (const std::string& warning : solution.warnings) {
    record.add_warnings(absl::StrCat("lenses: ", warning));
  }
  return record;
}

}  // namespace silhouette
