#include "tools/silhouette-calibrate/poses_calibration.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/files/calibration_session_file.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-calibrate/calibration_output.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using storage::v1::CalibrationRecord;

std::vector<PairedView> PairedViewsOf(const PoseProblem& problem, const PoseSolution& solution,
                                      const MaskSizes& masks) {
  std::vector<PairedView> views;
  for (size_t i = 0; i < solution.views.size(); ++i) {
    const SolvedView& view = solution.views[i];
    if (view.on_flange) continue;
    const CameraIntrinsics& lens = problem.views[i].lens;
    const auto mask = masks.find(view.name);
    views.push_back({.name = view.name,
                     .sizes = {.image = {lens.width, lens.height},
                               .mask = mask == masks.end() ? PixelSize{} : mask->second},
                     .camera = CameraModel(lens, view.camera_pose)});
  }
  return views;
}

// Without tags of which a corner was left out.
std::vector<TagSighting> GoodSightings(const PoseProblem& problem, const PoseSolution& solution) {
  std::set<size_t> bad;
  for (const CornerResidual& corner : solution.residuals) {
    if (corner.outlier) bad.insert(corner.sighting);
  }
  std::vector<TagSighting> good;
  for (size_t i = 0; i < problem.sightings.size(); ++i) {
    if (!bad.contains(i)) good.push_back(problem.sightings[i]);
  }
  return good;
}

CalibrationRecord RecordOf(const PoseSolution& solution, const PoseProvenance& provenance) {
  CalibrationRecord record = provenance.record;
  std::string boards;
  for (const SolvedBoard& board : solution.boards) {
    if (board.place == BoardPlace::kFlange) {
      absl::StrAppend(&boards, ", board '", board.name, "' on the flange");
    }
  }
  record.set_program(absl::StrCat("silhouette-calibrate ", provenance.command, ": ",
                                  solution.frames.size(), " frames", boards, "; lenses of ",
                                  provenance.lenses));
  const auto add = [&](const char* name, const std::string& of, double value, const char* unit) {
    storage::v1::CalibrationFigure& figure = *record.add_figures();
    figure.set_name(name);
    figure.set_of(of);
    figure.set_value(value);
    figure.set_unit(unit);
  };
  add("chi2_per_dof", "", solution.chi2_per_dof, "");
  for (const SolvedView& view : solution.views) {
    if (view.on_flange) continue;
    add("corners", view.name, view.corners, "");
    add("corner_rms", view.name, view.rms_px, "px");
    add("workspace_sigma", view.name, 1e3 * view.workspace_sigma, "mm");
    add("workspace_sigma_worst", view.name, 1e3 * view.workspace_sigma_worst, "mm");
  }
  for (const std::string& warning : solution.warnings) record.add_warnings(warning);
  return record;
}

}  // namespace

MaskSizes MaskSizesOf(const Cell& cell) {
  MaskSizes sizes;
  for (const ViewSettings& view : cell.views) {
    sizes[view.name] = {view.mask_size.width, view.mask_size.height};
  }
  return sizes;
}

absl::StatusOr<MaskSizes> MaskSizesFrom(const std::string& cell, const std::string& size,
                                        const PoseProblem& problem) {
  if (!size.empty()) {
    ASSIGN_OR_RETURN(const auto parsed, SizeFromText(size, "--mask-size"));
    MaskSizes sizes;
    for (const PoseView& view : problem.views) sizes[view.name] = parsed;
    return sizes;
  }
  if (cell.empty()) return MaskSizes();
  ASSIGN_OR_RETURN(const Cell loaded, LoadCell(cell));
  return MaskSizesOf(loaded);
}

bool HasViews(const PoseSolution& solution) {
  return std::any_of(solution.views.begin(), solution.views.end(),
                     [](const SolvedView& view) { return !view.on_flange; });
}

absl::StatusOr<std::string> WritePoseCalibration(const std::string& folder,
                                                 const PoseProblem& problem,
                                                 const PoseSolution& solution,
                                                 const PoseProvenance& provenance) {
  const std::vector<PairedView> views = PairedViewsOf(problem, solution, provenance.masks);
  CalibrationRecord record = RecordOf(solution, provenance);
  std::vector<PairResult> pairs;
  const bool sized = std::all_of(views.begin(), views.end(),
                                 [](const PairedView& view) { return view.sizes.mask.width > 0; });
  try {
    if (sized) pairs = FindPairs(views, GoodSightings(problem, solution), {});
  } catch (const std::invalid_argument& error) {
    record.add_warnings(absl::StrCat("no matrices: ", error.what()));
  }
  const std::string file = (fs::path(folder) / kSessionFileName).string();
  RETURN_IF_ERROR(
      WriteCalibrationFile({.views = views, .pairs = pairs, .cameras = folder}, record, file));
  return file;
}

}  // namespace silhouette
