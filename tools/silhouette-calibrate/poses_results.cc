#include "tools/silhouette-calibrate/poses_results.h"

#include <cmath>
#include <filesystem>
#include <iostream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/boards/csv.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-calibrate/camera_files.h"
#include "tools/silhouette-calibrate/residual_picture.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kMm = 1e-3;

const char* NameOf(BoardPlace place) {
  switch (place) {
    case BoardPlace::kFlange:
      return "flange";
    case BoardPlace::kStanding:
      return "standing";
    case BoardPlace::kSurveyed:
      return "surveyed";
    case BoardPlace::kLoose:
      return "loose";
  }
  return "";
}

Json PosesResultsJsonOf(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond rotation(pose.linear());
  const Eigen::Vector3d& t = pose.translation();
  return {{"translation", {t.x(), t.y(), t.z()}},
          {"quaternion", {rotation.x(), rotation.y(), rotation.z(), rotation.w()}}};
}

Json PosesResultsJsonOf(const PoseCovariance& covariance) {
  Json rows = Json::array();
  for (int i = 0; i < 6; ++i) {
    Json row = Json::array();
    for (int j = 0; j < 6; ++j) row.push_back(covariance(i, j));
    rows.push_back(row);
  }
  return rows;
}

// Of the camera's centre, and of its rotation: of the lengths of the errors.
double CentreSigma(const SolvedView& view) {
  return PointSigma(view.covariance, view.camera_pose.inverse().translation());
}
double RotationSigma(const PoseCovariance& covariance) {
  return std::sqrt(covariance.topLeftCorner<3, 3>().trace());
}

Json PosesResultsJsonOf(const SolvedView& view) {
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
  json["camera_from_world"] = PosesResultsJsonOf(view.camera_pose);
  json["covariance"] = PosesResultsJsonOf(view.covariance);
  return json;
}

Json PosesResultsJsonOf(const SolvedBoard& board) {
  Json json = {{"name", board.name}, {"place", NameOf(board.place)}};
  json[board.place == BoardPlace::kFlange ? "flange_from_board" : "base_from_board"] =
      PosesResultsJsonOf(board.pose);
  json["position_sigma_mm"] = std::sqrt(board.covariance.bottomRightCorner<3, 3>().trace()) / kMm;
  json["rotation_sigma_deg"] = RotationSigma(board.covariance) / kDegree;
  if (board.place == BoardPlace::kSurveyed) {
    json["survey_offset_mm"] = board.survey_offset / kMm;
    json["survey_rotation_deg"] = board.survey_rotation / kDegree;
    json["survey_outlier"] = board.survey_outlier;
  }
  return json;
}

Json PosesResultsJsonOf(const SolvedFrame& frame) {
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

}  // namespace

Json PosesJson(const PoseSolution& solution) {
  Json json = {{"chi2_per_dof", solution.chi2_per_dof},
               {"dof", solution.dof},
               {"image_noise_factor", solution.image_noise_factor},
               {"robot_noise_factor", solution.robot_noise_factor},
               {"survey_noise_factor", solution.survey_noise_factor},
               {"views", Json::array()},
               {"boards", Json::array()},
               {"frames", Json::array()},
               {"warnings", solution.warnings}};
  for (const SolvedView& view : solution.views) json["views"].push_back(PosesResultsJsonOf(view));
  for (const SolvedBoard& board : solution.boards)
    json["boards"].push_back(PosesResultsJsonOf(board));
  for (const SolvedFrame& frame : solution.frames)
    json["frames"].push_back(PosesResultsJsonOf(frame));
  return json;
}

void PrintPoses(const PoseSolution& solution) {
  std::cout << absl::StrFormat("%-14s %8s %8s %8s   %-22s %s\n", "view", "corners", "outliers",
                               "rms px", "camera (1 sigma)", "workspace (1 sigma)");
  for (const SolvedView& view : solution.views) {
    std::cout << absl::StrFormat("%-14s %8d %8d %8.3f   %-22s %.2f mm, worst %.2f mm%s\n",
                                 view.name, view.corners, view.outliers, view.rms_px,
                                 absl::StrFormat("%.2f mm, %.4f deg", CentreSigma(view) / kMm,
                                                 RotationSigma(view.covariance) / kDegree),
                                 view.workspace_sigma / kMm, view.workspace_sigma_worst / kMm,
                                 view.on_flange ? "  (pose in the flange)" : "");
  }
  for (const SolvedBoard& board : solution.boards) {
    const Eigen::Vector3d& t = board.pose.translation();
    const bool moves = board.place == BoardPlace::kFlange;
    std::cout << absl::StrFormat(
        "board %s is at %.2f, %.2f, %.2f mm in the %s (1 sigma %.2f mm)\n", board.name, t.x() / kMm,
        t.y() / kMm, t.z() / kMm, moves ? "flange" : "base",
        std::sqrt(board.covariance.bottomRightCorner<3, 3>().trace()) / kMm);
  }
  std::cout << absl::StrFormat("chi2/dof %.2f with the stated sigmas, %d degrees of freedom\n",
                               solution.chi2_per_dof, solution.dof);
  for (const std::string& warning : solution.warnings) std::cout << "warning: " << warning << '\n';
}

absl::StatusOr<std::vector<std::string>> WritePoses(const std::string& folder,
                                                    const PoseProblem& problem,
                                                    const PoseSolution& solution,
                                                    const PoseProvenance& provenance, bool draw) {
  std::vector<std::string> files;
  for (size_t i = 0; i < solution.views.size(); ++i) {
    const SolvedView& view = solution.views[i];
    ASSIGN_OR_RETURN(const std::string file,
                     WriteCameraFile(folder, view.on_flange ? view.name + ".flange" : view.name,
                                     CameraModel(problem.views[i].lens, view.camera_pose)));
    files.push_back(file);
  }
  if (HasViews(solution)) {
    ASSIGN_OR_RETURN(const auto file, WritePoseCalibration(folder, problem, solution, provenance));
    files.push_back(file);
  }
  const auto path = [&](const std::string& name) { return (fs::path(folder) / name).string(); };
  files.push_back(path("poses.json"));
  absl::Status written = WriteWholeFile(files.back(), PosesJson(solution).dump(2) + "\n");
  if (!written.ok()) return written;
  files.push_back(path("residuals.csv"));
  written = WriteWholeFile(files.back(), ResidualText(problem, solution));
  if (!written.ok()) return written;
  for (size_t i = 0; draw && i < solution.views.size(); ++i) {
    files.push_back(path(absl::StrCat("residuals_", solution.views[i].name, ".png")));
    written = WritePng(files.back(), ResidualPicture(problem, solution, i));
    if (!written.ok()) return written;
  }
  return files;
}

}  // namespace silhouette
