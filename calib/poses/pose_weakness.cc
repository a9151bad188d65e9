// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <Eigen/SVD>
#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/poses/pose_fit.h"
#include "calib/poses/pose_problem.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr const char* kGoodFrames =
    "in which the flange is turned about two axes, by 20 degrees and more, all over the workspace";

// Measurements more than unknowns: with fewer, a mistake would fit.
constexpr int kLeastFreedom = 8;
// Of all that turns about a second axis.
constexpr double kDecisiveTurn = 0.3;

// Counts of the robot's poses.
struct Robot {
  int used = 0;
  int left_out = 0;
};

Robot RobotOf(const Bundle& bundle) {
  std::set<int> seen;
  for (const BundleCorner& corner : bundle.corners) {
    if (corner.flange >= 0 && corner.used) seen.insert(corner.flange);
  }
  Robot robot;
  for (const int flange : seen) ++(bundle.flanges[flange].left_out ? robot.left_out : robot.used);
  return robot;
}

bool HasSurvey(const PoseSolution& solution) {
  return std::ranges::any_of(solution.boards, [](const SolvedBoard& board) {
    return board.place == BoardPlace::kSurveyed && !board.survey_outlier;
  });
}

absl::Status CheckRobotFrames(int least_frames, const PoseFit& fit, const PoseSolution& solution) {
  const Robot robot = RobotOf(fit.bundle);
  if (robot.used >= least_frames || HasSurvey(solution)) return absl::OkStatus();
  return FailedPrecondition(absl::StrCat(
      "only ", robot.used, " poses of the robot hold the cameras in its base",
      robot.left_out > 0 ? absl::StrCat(" (", robot.left_out, " more do not fit)") : std::string(),
      ", so that a wrong one would not show; at least ", least_frames,
      " are needed ('silhouette-calibrate poses --least-frames'): add ", least_frames - robot.used,
      " or more ", kGoodFrames));
}

absl::Status CheckFreedom(const PoseSolution& solution) {
  if (solution.dof >= kLeastFreedom) return absl::OkStatus();
  return FailedPrecondition(absl::StrCat(
      "what was seen is only ", std::max(0, solution.dof),
      " measurements more than there are unknowns, so that a mistake would not show; at least ",
      kLeastFreedom, " are needed: add two or more frames with a board, or larger boards"));
}

// The frame of a corner; of frames at one pose of the robot the first.
const std::string& StandOf(const PoseFit& fit, const BundleCorner& corner) {
  return corner.flange >= 0 ? fit.network.robot_poses[corner.flange].frame
                            : fit.network.looks[corner.look].frame;
}

// The frames in which a view saw boards.
struct ViewFrames {
  std::map<std::string, int> flanges;  // of each frame; -1: none
  bool surveyed = false;               // a board that it saw is
};

std::vector<ViewFrames> FramesOfViews(const PoseFit& fit) {
  std::vector<ViewFrames> views(fit.bundle.cameras.size());
  for (const BundleCorner& corner : fit.bundle.corners) {
    if (!corner.used) continue;
    ViewFrames& view = views[corner.camera];
    int& flange = view.flanges.try_emplace(StandOf(fit, corner), -1).first->second;
    flange = std::max(flange, corner.flange);
    const BundlePose& board = fit.bundle.board_poses[corner.board_pose];
    view.surveyed = view.surveyed || (board.has_prior && !board.left_out);
  }
  return views;
}

std::optional<std::string> DecisiveFrame(const PoseFit& fit, const ViewFrames& view) {
  std::vector<std::string> frames;
  std::vector<Eigen::Matrix3d> turns;
  for (const auto& [frame, flange] : view.flanges) {
    if (flange < 0) continue;
    frames.push_back(frame);
    turns.emplace_back(fit.bundle.flanges[flange].pose.linear());
  }
  const std::optional<size_t> decisive = DecisiveTurn(turns);
  return decisive ? std::optional(frames[*decisive]) : std::nullopt;
}

// The poses without a frame, or what the rest does not determine.
struct Rest {
  Bundle bundle;
  std::string undetermined;
};

Rest Without(const PoseFit& fit, const std::string& frame) {
  Rest rest{.bundle = fit.bundle, .undetermined{}};
  std::set<int> seeing;
  for (BundleCorner& corner : rest.bundle.corners) {
    corner.used = corner.used && StandOf(fit, corner) != frame;
    if (corner.used) seeing.insert(corner.camera);
  }
  for (size_t i = 0; i < rest.bundle.cameras.size(); ++i) {
    if (!seeing.contains(static_cast<int>(i))) rest.undetermined = rest.bundle.cameras[i].name;
  }
  if (!rest.undetermined.empty()) return rest;
  rest.undetermined =
      Adjust(rest.bundle, 0) ? FindCovariances(rest.bundle).undetermined : "anything";
  return rest;
}

absl::Status CheckWithout(const PoseFit& fit, const PoseSolution& solution,
                          const std::string& frame) {
  const Rest rest = Without(fit, frame);
  if (!rest.undetermined.empty()) {
    return FailedPrecondition("without the frame '", frame, "' the pose of ", rest.undetermined,
                              " is not determined, so that a mistake in it would not show; add "
                              "two or more frames like it, ",
                              kGoodFrames);
  }
  const std::vector<double> shifts = ShiftsOf(fit, rest.bundle);
  for (size_t i = 0; i < shifts.size(); ++i) {
    if (shifts[i] <= MostShift(solution.views[i].workspace_sigma)) continue;
    return FailedPrecondition(absl::StrFormat(
        "view '%s' is not stable: without the frame '%s' points of the workspace are %.1f mm "
        "elsewhere, where %.1f mm (1 sigma) are predicted; see whether this frame is right, or add "
        "five or more frames %s",
        solution.views[i].name, frame, 1000 * shifts[i], 1000 * solution.views[i].workspace_sigma,
        kGoodFrames));
  }
  return absl::OkStatus();
}

}  // namespace

std::optional<size_t> DecisiveTurn(std::span<const Eigen::Matrix3d> turns) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const Eigen::Matrix3d& turn : turns) sum += turn;
  // The flange's axis that turns least, and its direction in the base.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  double all = 0;
  double most = 0;
  size_t decisive = 0;
  for (size_t i = 0; i < turns.size(); ++i) {
    const double turn = (turns[i] * svd.matrixV().col(0) - svd.matrixU().col(0)).squaredNorm();
    all += turn;
    if (turn > most) decisive = i;
    most = std::max(most, turn);
  }
  return most > kDecisiveTurn * all ? std::optional(decisive) : std::nullopt;
}

absl::Status CheckWeakness(int least_frames, const PoseFit& fit, const PoseSolution& solution) {
  RETURN_IF_ERROR(CheckRobotFrames(least_frames, fit, solution));
  RETURN_IF_ERROR(CheckFreedom(solution));
  std::set<std::string> frames;
  for (const ViewFrames& view : FramesOfViews(fit)) {
    if (view.surveyed) continue;
    if (view.flanges.size() > kMostFramesTried) {
      if (const auto frame = DecisiveFrame(fit, view)) frames.insert(*frame);
      continue;
    }
    for (const auto& [frame, flange] : view.flanges) frames.insert(frame);
  }
  for (const std::string& frame : frames) RETURN_IF_ERROR(CheckWithout(fit, solution, frame));
  return absl::OkStatus();
}

}  // namespace silhouette
