// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
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
// With more frames, a single one does not decide.
constexpr size_t kMostFramesTried = 12;
// Without one frame, points of the workspace may be elsewhere by this many sigmas, or metres.
constexpr double kUnstable = 4;
constexpr double kHarmless = 1e-3;

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
      " are needed (--least-frames): add ", least_frames - robot.used, " or more ", kGoodFrames));
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

// Nothing if the rest does not determine all poses.
std::optional<Bundle> Without(const PoseFit& fit, const std::string& frame) {
  Bundle rest = fit.bundle;
  for (BundleCorner& corner : rest.corners) {
    corner.used = corner.used && StandOf(fit, corner) != frame;
  }
  if (!Adjust(rest, 0) || !FindCovariances(rest).undetermined.empty()) return std::nullopt;
  return rest;
}

absl::Status CheckWithout(const PoseFit& fit, const PoseSolution& solution,
                          const std::string& frame) {
  const std::optional<Bundle> rest = Without(fit, frame);
  if (!rest) {
    return FailedPrecondition("without the frame '", frame,
                              "' the poses are not determined, so that a mistake in it would not "
                              "show; add two or more frames like it, ",
                              kGoodFrames);
  }
  const std::vector<double> shifts = ShiftsOf(fit, *rest);
  for (size_t i = 0; i < shifts.size(); ++i) {
    const double limit = std::max(kHarmless, kUnstable * solution.views[i].workspace_sigma);
    if (shifts[i] <= limit) continue;
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

absl::Status CheckWeakness(int least_frames, const PoseFit& fit, const PoseSolution& solution) {
  RETURN_IF_ERROR(CheckRobotFrames(least_frames, fit, solution));
  RETURN_IF_ERROR(CheckFreedom(solution));
  std::set<std::string> frames;
  for (const BundleCorner& corner : fit.bundle.corners) {
    if (corner.used) frames.insert(StandOf(fit, corner));
  }
  if (frames.size() > kMostFramesTried || HasSurvey(solution)) return absl::OkStatus();
  for (const std::string& frame : frames) RETURN_IF_ERROR(CheckWithout(fit, solution, frame));
  return absl::OkStatus();
}

}  // namespace silhouette
