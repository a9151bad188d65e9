// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/results.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/boards/csv.h"
#include "calib/files/calibration_session_file.h"
#include "calib/report/quality_report.h"
#include "calib/report/report_page.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-calibrate/calibration_output.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/pictures.h"
#include "tools/silhouette-calibrate/poses_inputs.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using storage::v1::CalibrationRecord;

constexpr double kMm = 1e-3;

std::string NamesOf(const LensGroup& group, const LensSolution& solution) {
  return absl::StrJoin(group.cameras, ", ", [&](std::string* out, size_t camera) {
    out->append(solution.cameras[camera].name);
  });
}

std::string TextOfWarnings(const std::vector<std::string>& warnings) {
  std::string text;
  for (const std::string& warning : warnings) absl::StrAppend(&text, "warning: ", warning, "\n");
  return text;
}

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

// False: it is of pairs of poses, and figures of corners mean nothing.
bool HasCorners(const PoseSolution& solution) { return solution.dof > 0; }

void Erase(std::initializer_list<const char*> names, Json& json) {
  for (const char* name : names) json.erase(name);
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
    SetFigure(name, of, value, unit, record);
  };
  if (HasCorners(solution)) add("chi2_per_dof", "", solution.chi2_per_dof, "");
  for (const SolvedView& view : solution.views) {
    if (view.on_flange) continue;
    if (HasCorners(solution)) add("corners", view.name, view.corners, "");
    if (HasCorners(solution)) add("corner_rms", view.name, view.rms_px, "px");
    add("workspace_sigma", view.name, 1e3 * view.workspace_sigma, "mm");
    add("workspace_sigma_worst", view.name, 1e3 * view.workspace_sigma_worst, "mm");
  }
  for (const std::string& warning : solution.warnings) record.add_warnings(warning);
  return record;
}

const char* NameOf(BoardPlace place) {
  return std::array{"loose", "flange", "standing", "surveyed"}[static_cast<size_t>(place)];
}

Json JsonOf(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond rotation(pose.linear());
  const Eigen::Vector3d& t = pose.translation();
  return {{"translation", {t.x(), t.y(), t.z()}},
          {"quaternion", {rotation.x(), rotation.y(), rotation.z(), rotation.w()}}};
}

Json JsonOf(const PoseCovariance& covariance) {
  Json rows = Json::array();
  for (const auto& row : covariance.rowwise()) rows.push_back(std::vector(row.begin(), row.end()));
  return rows;
}

// Of the camera's centre, and of its rotation: of the lengths of the errors.
double CentreSigma(const SolvedView& view) {
  return PointSigma(view.covariance, view.camera_pose.inverse().translation());
}
double RotationSigma(const PoseCovariance& covariance) {
  return std::sqrt(covariance.topLeftCorner<3, 3>().trace());
}

double PositionSigma(const SolvedBoard& board) {
  return std::sqrt(board.covariance.bottomRightCorner<3, 3>().trace());
}

Json JsonOf(const SolvedView& view) {
  Json json = {{"name", view.name},
               {"world", view.on_flange ? "flange" : "base"},
               {"corners", view.corners},
               {"outliers", view.outliers},
               {"rms_px", view.rms_px},
               {"worst_px", view.worst_px},
               {"centre_sigma_mm", CentreSigma(view) / kMm},
               {"rotation_sigma_deg", RotationSigma(view.covariance) / kDegree},
               {"workspace_sigma_mm", view.workspace_sigma / kMm},
               {"workspace_sigma_worst_mm", view.workspace_sigma_worst / kMm}};
  json["camera_from_world"] = JsonOf(view.camera_pose);
  json["covariance"] = JsonOf(view.covariance);
  return json;
}

Json JsonOf(const SolvedBoard& board) {
  Json json = {{"name", board.name}, {"place", NameOf(board.place)}};
  json[board.place == BoardPlace::kFlange ? "flange_from_board" : "base_from_board"] =
      JsonOf(board.pose);
  json["size"] = board.size;
  json["position_sigma_mm"] = PositionSigma(board) / kMm;
  json["rotation_sigma_deg"] = RotationSigma(board.covariance) / kDegree;
  if (board.place == BoardPlace::kSurveyed) {
    json["survey_offset_mm"] = board.survey_offset / kMm;
    json["survey_rotation_deg"] = board.survey_rotation / kDegree;
    json["survey_outlier"] = board.survey_outlier;
  }
  return json;
}

Json JsonOf(const SolvedFrame& frame) {
  return {{"name", frame.name},
          {"corners", frame.corners},
          {"outliers", frame.outliers},
          {"rms_px", frame.rms_px},
          {"robot_offset_mm", frame.robot_offset / kMm},
          {"robot_rotation_deg", frame.robot_rotation / kDegree},
          {"robot_outlier", frame.robot_outlier}};
}

std::string ResidualText(const PoseProblem& problem, const PoseSolution& solution) {
  std::string text = "frame,view,family,tag,corner,dx,dy,outlier\n";
  for (const CornerResidual& corner : solution.residuals) {
    const TagSighting& seen = problem.sightings[corner.sighting];
    absl::StrAppend(&text, CsvField(seen.frame), ",", CsvField(seen.view), ",", seen.family, ",",
                    seen.tag, ",", corner.corner, ",", CsvNumber(corner.residual.x()), ",",
                    CsvNumber(corner.residual.y()), ",", corner.outlier ? 1 : 0, "\n");
  }
  return text;
}

Picture ResidualPicture(const PoseProblem& problem, const PoseSolution& solution, size_t view) {
  const CameraIntrinsics& lens = problem.views[view].lens;
  const SolvedView& solved = solution.views[view];
  std::vector<LensResidual> residuals;
  for (const CornerResidual& corner : solution.residuals) {
    const TagSighting& seen = problem.sightings[corner.sighting];
    if (seen.view != solved.name) continue;
    residuals.push_back({.frame{},
                         .board{},
                         .seen = seen.corners[static_cast<size_t>(corner.corner)],
                         .residual = corner.residual,
                         .outlier = corner.outlier});
  }
  return PictureOfResiduals(solved.name, {lens.width, lens.height}, solved.rms_px, residuals,
                            absl::StrFormat("%d corners, %.3f px rms per axis, %d left out",
                                            solved.corners, solved.rms_px, solved.outliers));
}

std::vector<std::pair<std::string, std::string>> OriginOf(const PoseSources& sources) {
  std::vector<std::pair<std::string, std::string>> origin = {
      {"made", absl::FormatTime("%Y-%m-%d %H:%M UTC", absl::Now(), absl::UTCTimeZone())}};
  const auto add = [&](const std::string& name, const std::string& value) {
    if (!value.empty()) origin.emplace_back(name, value);
  };
  add("corners", sources.corners);
  add("boards", sources.boards);
  add("lenses", sources.cameras);
  add("robot poses", sources.robot_poses);
  add("joint values", sources.joints);
  add("survey", sources.survey);
  return origin;
}

Json MapJson(const LensMap& map) {
  Json sigmas = Json::array();
  for (const double sigma : map.sigmas) {
    sigmas.push_back(std::isfinite(sigma) ? Json(sigma) : Json());
  }
  return {
      {"columns", map.columns}, {"rows", map.rows}, {"limit_px", map.limit}, {"sigma_px", sigmas}};
}

}  // namespace

std::string LensText(const LensSolution& solution, const std::vector<std::string>& files) {
  Table table{{"view", "images", "corners", "left out", "rms px", "focal lengths px", "centre",
               "edge", "seen", "known"}};
  bool predicted = false;
  for (const SolvedCamera& camera : solution.cameras) {
    const bool given = camera.edge_sigma == 0;
    predicted = predicted || !given;
    table.rows.push_back({camera.name, absl::StrCat(camera.images), absl::StrCat(camera.corners),
                          absl::StrCat(camera.outliers), absl::StrFormat("%.3f", camera.rms),
                          absl::StrFormat("%.2f %.2f", camera.intrinsics[0], camera.intrinsics[1]),
                          given ? "given" : absl::StrFormat("%.3f", camera.centre_sigma),
                          given ? "" : absl::StrFormat("%.3f", camera.edge_sigma),
                          given ? "" : absl::StrFormat("%.0f %%", 100 * camera.covered),
                          given ? "" : absl::StrFormat("%.0f %%", 100 * camera.map.KnownShare())});
  }
  std::string text = TextOf(table);
  if (predicted) {
    text +=
        "centre, edge: standard deviation of a projection there, px, at the boards' distance\n"
        "known: share of the image in which it is at most that of --most-uncertain\n";
  }
  for (const LensGroup& group : solution.groups) {
    if (solution.groups.size() > 1) absl::StrAppend(&text, NamesOf(group, solution), ": ");
    absl::StrAppendFormat(&text, "residuals are %.2f times what the corners' sigma says",
                          group.noise);
    if (group.warp) {
      absl::StrAppendFormat(&text, "; the board is bent by %.2f mm along, %.2f mm across",
                            1000 * std::abs(group.warp->x()), 1000 * std::abs(group.warp->y()));
    }
    if (group.apart > 0) {
      absl::StrAppendFormat(&text,
                            "; boards seen by several cameras: off by %.3f px, by each camera "
                            "alone %.3f px",
                            group.together, group.apart);
    }
    text += "\n";
  }
  return absl::StrCat(text, TextOfWarnings(solution.warnings), TextOfFiles(files));
}

Json LensJson(const LensSolution& solution, const std::vector<std::string>& files) {
  const auto number = [](double value) { return std::isfinite(value) ? Json(value) : Json(); };
  Json cameras = Json::array();
  for (const SolvedCamera& camera : solution.cameras) {
    cameras.push_back({{"view", camera.name},
                       {"lens_model", camera.lens_model},
                       {"intrinsics", camera.intrinsics},
                       {"group", camera.group},
                       {"images", camera.images},
                       {"corners", camera.corners},
                       {"outliers", camera.outliers},
                       {"rms_px", number(camera.rms)},
                       {"focal_length_sigma", number(camera.focal_length_sigma)},
                       {"centre_sigma_px", number(camera.centre_sigma)},
                       {"edge_sigma_px", number(camera.edge_sigma)},
                       {"covered", camera.covered},
                       {"known", camera.map.KnownShare()},
                       {"map", MapJson(camera.map)},
                       {"distance", camera.distance}});
  }
  Json groups = Json::array();
  for (const LensGroup& group : solution.groups) {
    std::vector<std::string> names;
    for (const size_t camera : group.cameras) names.push_back(solution.cameras[camera].name);
    Json warp;
    if (group.warp) warp = {group.warp->x(), group.warp->y()};
    groups.push_back({{"views", names},
                      {"noise_per_sigma", number(group.noise)},
                      {"together_px", number(group.together)},
                      {"apart_px", number(group.apart)},
                      {"warp", warp}});
  }
  return {
      {"cameras", cameras}, {"groups", groups}, {"warnings", solution.warnings}, {"files", files}};
}

storage::v1::CalibrationRecord RecordOf(const LensSolution& solution) {
  storage::v1::CalibrationRecord record;
  for (const SolvedCamera& camera : solution.cameras) {
    const auto add = [&](const char* name, double value, const char* unit) {
      SetFigure(name, camera.name, value, unit, record);
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

absl::StatusOr<PoseSolution> CalibratePosesInSteps(PoseProblem problem) {
  Steps steps("poses");
  problem.step = [&](const std::string& step) { steps.Begin(step); };
  return CalibratePoses(problem);
}

bool HasViews(const PoseSolution& solution) {
  return std::ranges::any_of(solution.views,
                             [](const SolvedView& view) { return !view.on_flange; });
}

absl::StatusOr<std::string> WritePoseCalibration(const std::string& folder,
                                                 const PoseProblem& problem,
                                                 const PoseSolution& solution,
                                                 const PoseProvenance& provenance) {
  const std::vector<PairedView> views = PairedViewsOf(problem, solution, provenance.masks);
  CalibrationRecord record = RecordOf(solution, provenance);
  std::vector<PairResult> pairs;
  const bool sized =
      std::ranges::all_of(views, [](const PairedView& view) { return view.sizes.mask.width > 0; });
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

Json PosesJson(const PoseSolution& solution) {
  Json json = {{"chi2_per_dof", solution.chi2_per_dof},
               {"dof", solution.dof},
               {"image_noise_factor", solution.image_noise_factor},
               {"robot_noise_factor", solution.robot_noise_factor},
               {"survey_noise_factor", solution.survey_noise_factor},
               {"views", Json::array()},
               {"boards", Json::array()},
               {"frames", Json::array()},
               {"noise", Json::array()},
               {"warnings", solution.warnings}};
  for (const SolvedNoise& noise : solution.noise) {
    json["noise"].push_back({{"view", noise.view},
                             {"board", noise.board},
                             {"stated_px", noise.stated},
                             {"px", noise.sigma}});
  }
  for (const SolvedView& view : solution.views) json["views"].push_back(JsonOf(view));
  for (const SolvedBoard& board : solution.boards) json["boards"].push_back(JsonOf(board));
  for (const SolvedFrame& frame : solution.frames) json["frames"].push_back(JsonOf(frame));
  if (HasCorners(solution)) return json;
  Erase({"chi2_per_dof", "dof", "image_noise_factor", "robot_noise_factor", "survey_noise_factor",
         "boards", "noise"},
        json);
  for (Json& view : json["views"]) Erase({"corners", "outliers", "rms_px", "worst_px"}, view);
  for (Json& frame : json["frames"]) Erase({"corners", "outliers", "rms_px"}, frame);
  return json;
}

std::string PosesText(const PoseSolution& solution) {
  Table table{{"view", "corners", "outliers", "rms px", "camera (1 sigma)", "workspace (1 sigma)"}};
  const bool corners = HasCorners(solution);
  for (const SolvedView& view : solution.views) {
    table.rows.push_back({view.name, corners ? absl::StrCat(view.corners) : "",
                          corners ? absl::StrCat(view.outliers) : "",
                          corners ? absl::StrFormat("%.3f", view.rms_px) : "",
                          absl::StrFormat("%.2f mm, %.4f deg", CentreSigma(view) / kMm,
                                          RotationSigma(view.covariance) / kDegree),
                          absl::StrFormat("%.2f mm, worst %.2f mm%s", view.workspace_sigma / kMm,
                                          view.workspace_sigma_worst / kMm,
                                          view.on_flange ? "  (pose in the flange)" : "")});
  }
  std::string text = TextOf(table);
  for (const SolvedBoard& board : solution.boards) {
    const Eigen::Vector3d& t = board.pose.translation();
    absl::StrAppendFormat(&text, "board %s is at %.2f, %.2f, %.2f mm in the %s (1 sigma %.2f mm)\n",
                          board.name, t.x() / kMm, t.y() / kMm, t.z() / kMm,
                          board.place == BoardPlace::kFlange ? "flange" : "base",
                          PositionSigma(board) / kMm);
  }
  if (corners) {
    absl::StrAppendFormat(&text,
                          "chi2/dof %.2f with the stated sigmas of robot and survey, "
                          "%d degrees of freedom\n",
                          solution.chi2_per_dof, solution.dof);
  }
  return text + TextOfWarnings(solution.warnings);
}

namespace {

// As WritePoses, into a folder for this alone.
absl::StatusOr<std::vector<std::string>> WritePoseFiles(const std::string& folder,
                                                        const PoseProblem& problem,
                                                        const PoseSolution& solution,
                                                        const PoseProvenance& provenance,
                                                        bool draw) {
  std::vector<std::string> files;
  for (size_t i = 0; i < solution.views.size(); ++i) {
    const SolvedView& view = solution.views[i];
    ASSIGN_OR_RETURN(const std::string file,
                     WriteCameraFile(folder, view.on_flange ? view.name + ".flange" : view.name,
                                     CameraModel(problem.views[i].lens, view.camera_pose),
                                     problem.views[i].known));
    files.push_back(file);
  }
  if (HasViews(solution)) {
    ASSIGN_OR_RETURN(const auto file, WritePoseCalibration(folder, problem, solution, provenance));
    files.push_back(file);
  }
  const auto path = [&](const std::string& name) { return (fs::path(folder) / name).string(); };
  files.push_back(path("poses.json"));
  RETURN_IF_ERROR(WriteWholeFile(files.back(), PosesJson(solution).dump(2) + "\n"));
  files.push_back(path("residuals.csv"));
  RETURN_IF_ERROR(WriteWholeFile(files.back(), ResidualText(problem, solution)));
  for (size_t i = 0; draw && i < solution.views.size(); ++i) {
    files.push_back(path(absl::StrCat("residuals_", solution.views[i].name, ".png")));
    RETURN_IF_ERROR(WritePng(files.back(), ResidualPicture(problem, solution, i)));
  }
  return files;
}

// Moves files into the folder. The existing calibration.yaml goes first, then the other existing
// files; the new calibration.yaml comes last. Cut short, it leaves a folder that lacks cameras, or
// one without calibration.yaml whose cameras belong together.
absl::Status PutInPlace(std::vector<fs::path> files, const fs::path& folder) {
  std::stable_partition(files.begin(), files.end(),
                        [](const fs::path& file) { return file.filename() == kSessionFileName; });
  std::error_code error;
  for (const fs::path& file : files) fs::remove(folder / file.filename(), error);
  std::ranges::reverse(files);
  for (const fs::path& file : files) {
    const fs::path place = folder / file.filename();
    fs::rename(file, place, error);
    if (!error) continue;
    return FailedPrecondition("'", place.string(), "' cannot be written: ", error.message());
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<std::string>> WritePoses(const std::string& folder,
                                                    const PoseProblem& problem,
                                                    const PoseSolution& solution,
                                                    const PoseProvenance& provenance, bool draw) {
  const fs::path unfinished = fs::path(folder) / ".unfinished";
  auto files = WritePoseFiles(unfinished.string(), problem, solution, provenance, draw);
  absl::Status status = files.status();
  if (status.ok()) status = PutInPlace({files->begin(), files->end()}, folder);
  std::error_code ignored;
  fs::remove_all(unfinished, ignored);
  RETURN_IF_ERROR(status);
  for (std::string& file : *files) {
    file = (fs::path(folder) / fs::path(file).filename()).string();
  }
  return files;
}

absl::StatusOr<QualityReport> ReportOn(PoseProblem problem, const PoseSources& sources,
                                       const std::string& workspace_box, int groups) {
  ASSIGN_OR_RETURN(WorkspacePoints workspace, WorkspacePointsOf(sources, workspace_box));
  Steps steps("report");
  problem.step = [&](const std::string& step) { steps.Begin(step); };
  problem.workspace = std::move(workspace.points);
  return MakeReport(problem, {.workspace_name = std::move(workspace.name), .groups = groups});
}

absl::StatusOr<std::vector<std::string>> WriteReport(const QualityReport& report,
                                                     const PoseSources& sources,
                                                     const std::string& page,
                                                     const std::string& json) {
  std::vector<std::string> files;
  if (!page.empty()) {
    RETURN_IF_ERROR(WriteWholeFile(page, ReportHtml(report, OriginOf(sources))));
    files.push_back(page);
  }
  if (!json.empty()) {
    RETURN_IF_ERROR(WriteWholeFile(json, ReportJson(report).dump(2) + "\n"));
    files.push_back(json);
  }
  return files;
}

}  // namespace silhouette
