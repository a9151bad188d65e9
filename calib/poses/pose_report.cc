// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {
namespace {

struct Count {
  int used = 0;
  int left_out = 0;
  double sum = 0;  // of squares, pixels
  double longest = 0;

  void Add(const BundleCorner& corner) {
    if (!corner.used) {
      ++left_out;
      return;
    }
    ++used;
    sum += corner.residual.squaredNorm();
    longest = std::max(longest, corner.residual.norm());
  }
  double RmsPerAxis() const { return used > 0 ? std::sqrt(sum / (2 * used)) : 0; }
};

void FindWorkspaceSigma(const std::vector<Eigen::Vector3d>& points, SolvedView& view) {
  if (points.empty()) return;
  double sum = 0;
  for (const Eigen::Vector3d& point : points) {
    const double sigma = PointSigma(view.covariance, point);
    sum += sigma * sigma;
    view.workspace_sigma_worst = std::max(view.workspace_sigma_worst, sigma);
  }
  view.workspace_sigma = std::sqrt(sum / static_cast<double>(points.size()));
}

void AddViews(const PoseFit& fit, PoseSolution& solution) {
  std::vector<Count> counts(fit.bundle.cameras.size());
  for (const BundleCorner& corner : fit.bundle.corners) counts[corner.camera].Add(corner);
  const WorkspaceBoxes boxes(fit);
  for (size_t i = 0; i < counts.size(); ++i) {
    const PoseView& view = fit.network.views[i];
    SolvedView solved{.name = view.name,
                      .on_flange = view.on_flange,
                      .camera_pose = fit.bundle.cameras[i].pose,
                      .covariance = fit.bundle.cameras[i].covariance,
                      .corners = counts[i].used,
                      .outliers = counts[i].left_out,
                      .rms_px = counts[i].RmsPerAxis(),
                      .worst_px = counts[i].longest};
    FindWorkspaceSigma(boxes.PointsFor(view.on_flange), solved);
    solution.views.push_back(std::move(solved));
  }
}

void AddBoards(const PoseFit& fit, PoseSolution& solution) {
  for (size_t i = 0; i < fit.network.board_poses.size(); ++i) {
    const BundlePose& pose = fit.bundle.board_poses[i];
    const PoseBoard& board = fit.network.boards[fit.network.board_poses[i].board];
    if (board.place == BoardPlace::kLoose || pose.covariance.isZero(0)) continue;
    Eigen::Isometry3d survey = Eigen::Isometry3d::Identity();
    if (pose.has_prior) survey = pose.measured.inverse() * pose.pose;
    solution.boards.push_back({.name = board.board.description().name,
                               .place = board.place,
                               .pose = pose.pose,
                               .covariance = pose.covariance,
                               .survey_offset = survey.translation().norm(),
                               .survey_rotation = Eigen::AngleAxisd(survey.linear()).angle(),
                               .survey_outlier = pose.left_out,
                               .size = fit.bundle.sizes[fit.network.board_poses[i].board]});
  }
}

void AddFrames(const PoseFit& fit, PoseSolution& solution) {
  std::map<std::string, size_t> places;
  std::vector<Count> counts;
  for (const BundleCorner& corner : fit.bundle.corners) {
    const std::string& frame = fit.network.looks[corner.look].frame;
    const auto [place, added] = places.emplace(frame, solution.frames.size());
    if (added) {
      solution.frames.push_back({.name = frame});
      counts.emplace_back();
    }
    counts[place->second].Add(corner);
    if (corner.flange < 0) continue;
    const BundlePose& flange = fit.bundle.flanges[corner.flange];
    const Eigen::Isometry3d motion = flange.measured.inverse() * flange.pose;
    SolvedFrame& solved = solution.frames[place->second];
    solved.robot_offset = motion.translation().norm();
    solved.robot_rotation = Eigen::AngleAxisd(motion.linear()).angle();
    solved.robot_outlier = flange.left_out;
  }
  for (size_t i = 0; i < counts.size(); ++i) {
    solution.frames[i].corners = counts[i].used;
    solution.frames[i].outliers = counts[i].left_out;
    solution.frames[i].rms_px = counts[i].RmsPerAxis();
  }
}

void AddResiduals(const PoseFit& fit, PoseSolution& solution) {
  for (const BundleCorner& corner : fit.bundle.corners) {
    const LookCorner& seen = fit.network.looks[corner.look].corners[corner.place];
    solution.residuals.push_back({.sighting = seen.sighting,
                                  .corner = seen.corner,
                                  .residual = corner.residual,
                                  .outlier = !corner.used});
  }
}

void AddNoise(const PoseFit& fit, PoseSolution& solution) {
  for (const BundlePart& part : fit.bundle.parts) {
    solution.noise.push_back({.view = fit.network.views[part.camera].name,
                              .board = fit.network.boards[part.size].board.description().name,
                              .stated = part.stated,
                              .sigma = part.sigma});
  }
}

void WarnOfFrames(PoseSolution& solution) {
  std::vector<std::string> corners;
  std::vector<std::string> robot;
  for (const SolvedFrame& frame : solution.frames) {
    if (frame.outliers > 0) {
      corners.push_back(absl::StrCat("'", frame.name, "' (", frame.outliers, ")"));
    }
    if (frame.robot_outlier) {
      robot.push_back(absl::StrFormat("'%s' (%.2f mm, %.3f deg)", frame.name,
                                      1000 * frame.robot_offset, frame.robot_rotation / kDegree));
    }
  }
  if (!corners.empty()) {
    solution.warnings.push_back(absl::StrCat(
        "tags that do not fit were left out, in the frames (corners) ", FewOf(corners)));
  }
  if (!robot.empty()) {
    solution.warnings.push_back(
        absl::StrCat("the robot stood elsewhere than it said, and its pose was left out, in the "
                     "frames ",
                     FewOf(robot)));
  }
}

void WarnOfSurvey(const NoiseFactors& factors, PoseSolution& solution) {
  std::vector<std::string> boards;
  for (const SolvedBoard& board : solution.boards) {
    if (!board.survey_outlier) continue;
    boards.push_back(absl::StrFormat("'%s' (%.1f mm, %.2f deg)", board.name,
                                     1000 * board.survey_offset, board.survey_rotation / kDegree));
  }
  if (!boards.empty()) {
    solution.warnings.push_back(absl::StrCat(
        "boards stand elsewhere than the survey says, which was left out: ", FewOf(boards)));
  }
  if (factors.survey > 1.5) {
    solution.warnings.push_back(absl::StrFormat(
        "surveyed boards are off by %.1f times the sigma stated in the survey", factors.survey));
  }
}

void WarnOfNoise(const PoseFit& fit, const NoiseFactors& factors, PoseSolution& solution) {
  constexpr double kMuch = 3e-4;  // of the image's width
  std::vector<std::string> noisy;
  for (const BundlePart& part : fit.bundle.parts) {
    const PoseView& view = fit.network.views[part.camera];
    if (part.sigma < std::max(2 * part.stated, kMuch * view.lens.width)) continue;
    noisy.push_back(absl::StrFormat("board '%s' in view '%s' (%.2f px)",
                                    fit.network.boards[part.size].board.description().name,
                                    view.name, part.sigma));
  }
  if (!noisy.empty()) {
    solution.warnings.push_back(
        absl::StrCat("corners are farther off than detection explains, which is reckoned with; the "
                     "lens, the print or the paper may not be as described: ",
                     FewOf(noisy)));
  }
  if (factors.robot > 1.5) {
    const BundlePose& flange = fit.bundle.flanges.front();  // enlarged already
    solution.warnings.push_back(absl::StrFormat(
        "the robot's poses are off by %.1f times the sigma stated: either it is less precise, and "
        "--robot-sigma %.2gmm,%.2gdeg would be right, or a lens is not as described, or a camera "
        "or a board moved meanwhile; 'silhouette-calibrate report' can tell",
        factors.robot, 1000 * flange.position_sigma, flange.rotation_sigma / kDegree));
  }
}

void WarnOfWeakness(const PoseFit& fit, PoseSolution& solution) {
  constexpr int kFewFrames = 10;
  std::set<int> flanges;
  for (const BundleCorner& corner : fit.bundle.corners) {
    if (corner.flange >= 0) flanges.insert(corner.flange);
  }
  if (!flanges.empty() && flanges.size() < kFewFrames) {
    solution.warnings.push_back(
        absl::StrCat("only ", flanges.size(),
                     " poses of the robot took part; twenty and more make good cameras, and show "
                     "mistakes"));
  }
  for (const SolvedView& view : solution.views) {
    const std::string weakness = WeaknessOf(view);
    if (!weakness.empty()) solution.warnings.push_back(weakness);
  }
}

}  // namespace

WorkspaceBoxes::WorkspaceBoxes(const PoseFit& fit) {
  for (const BundleCorner& corner : fit.bundle.corners) {
    if (!corner.used) continue;
    (corner.camera_on_flange ? in_flange_ : in_base_)
        .extend(fit.bundle.LinkOf(corner) * fit.bundle.board_poses[corner.board_pose].pose *
                corner.point);
  }
}

std::vector<Eigen::Vector3d> WorkspaceBoxes::PointsFor(bool on_flange) const {
  constexpr int kSteps = 4;
  const Eigen::AlignedBox3d& box = on_flange ? in_flange_ : in_base_;
  if (box.isEmpty()) return {};
  return PointsOf(box, kSteps);
}

std::vector<double> ShiftsOf(const PoseFit& fit, const Bundle& other) {
  const WorkspaceBoxes boxes(fit);
  std::vector<double> shifts;
  for (size_t i = 0; i < fit.bundle.cameras.size(); ++i) {
    double sum = 0;
    const std::vector<Eigen::Vector3d> points = boxes.PointsFor(fit.network.views[i].on_flange);
    for (const Eigen::Vector3d& point : points) {
      sum += (fit.bundle.cameras[i].pose * point - other.cameras[i].pose * point).squaredNorm();
    }
    shifts.push_back(points.empty() ? 0 : std::sqrt(sum / static_cast<double>(points.size())));
  }
  return shifts;
}

double PointSigma(const PoseCovariance& covariance, const Eigen::Vector3d& point) {
  const Eigen::Matrix<double, 3, 6> motion = DerivativeByMotion(point);
  return std::sqrt(std::max(0.0, (motion * covariance * motion.transpose()).trace()));
}

std::string WeaknessOf(const SolvedView& view) {
  constexpr double kWeak = 3e-3;
  if (view.workspace_sigma_worst <= kWeak) return "";
  return absl::StrFormat(
      "view '%s' is known poorly: points of the workspace may be off by %.1f mm (1 sigma); add "
      "poses all over the workspace, turned about two axes",
      view.name, 1000 * view.workspace_sigma_worst);
}

PoseSolution SolutionOf(const PoseFit& fit, const BundleStatistics& statistics,
                        const NoiseFactors& factors) {
  PoseSolution solution;
  solution.chi2_per_dof = factors.chi2_per_dof;
  solution.dof = statistics.dof;
  solution.image_noise_factor = factors.image;
  solution.robot_noise_factor = factors.robot;
  solution.survey_noise_factor = factors.survey;
  solution.warnings = fit.network.warnings;
  AddViews(fit, solution);
  AddBoards(fit, solution);
  AddFrames(fit, solution);
  AddResiduals(fit, solution);
  AddNoise(fit, solution);
  WarnOfFrames(solution);
  WarnOfSurvey(factors, solution);
  WarnOfNoise(fit, factors, solution);
  WarnOfWeakness(fit, solution);
  return solution;
}

}  // namespace silhouette
