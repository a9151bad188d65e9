// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_fit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/poses/pose_network.h"
#include "calib/poses/pose_noise.h"
#include "calib/poses/pose_problem.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

const std::string& NameOf(const PoseNetwork& network, const BoardPose& board_pose) {
  return network.boards[board_pose.board].board.description().name;
}

// Loose boards that one view saw in a frame say nothing of the view's pose.
std::vector<bool> UsableLooks(const PoseNetwork& network) {
  std::map<int, int> looks_of_board;
  for (const Look& look : network.looks) ++looks_of_board[look.board_pose];
  std::vector<bool> usable;
  for (const Look& look : network.looks) {
    const BoardPose& board = network.board_poses[look.board_pose];
    const bool loose = network.boards[board.board].place == BoardPlace::kLoose;
    usable.push_back(board.pose && network.camera_poses[look.view] &&
                     !(loose && looks_of_board[look.board_pose] == 1));
  }
  return usable;
}

void AddPoses(const PoseNetwork& network, const RobotNoise& noise, Bundle& bundle) {
  for (size_t i = 0; i < network.views.size(); ++i) {
    bundle.lenses.push_back(network.views[i].lens);
    bundle.cameras.push_back({.name = absl::StrCat("view '", network.views[i].name, "'"),
                              .pose = *network.camera_poses[i]});
  }
  for (size_t i = 0; i < network.robot_poses.size(); ++i) {
    const RobotPose& robot = network.robot_poses[i];
    BundlePose pose =
        MeasuredPose(robot.base_from_flange, noise.position_sigma, noise.rotation_sigma);
    pose.name = absl::StrCat("the flange in frame '", robot.frame, "'");
    pose.has_prior = network.same_as[i] == static_cast<int>(i);
    pose.constant = true;
    bundle.flanges.push_back(std::move(pose));
  }
  for (const BoardPose& board_pose : network.board_poses) {
    const PoseBoard& board = network.boards[board_pose.board];
    BundlePose pose;
    if (board.place == BoardPlace::kSurveyed) {
      pose = MeasuredPose(board.base_from_board, board.position_sigma, board.rotation_sigma);
    }
    pose.name = absl::StrCat("the board '", NameOf(network, board_pose), "'");
    pose.pose = board_pose.pose.value_or(Eigen::Isometry3d::Identity());
    bundle.board_poses.push_back(std::move(pose));
  }
  bundle.sizes.assign(network.boards.size(), 1);
  bundle.size_sigmas.assign(network.boards.size(), 0);
}

Bundle BundleOf(const PoseNetwork& network, const RobotNoise& noise) {
  Bundle bundle;
  AddPoses(network, noise, bundle);
  const std::vector<bool> usable = UsableLooks(network);
  for (size_t i = 0; i < network.looks.size(); ++i) {
    if (!usable[i]) continue;
    for (size_t k = 0; k < network.looks[i].corners.size(); ++k) {
      bundle.corners.push_back(CornerOf(network, i, k));
    }
  }
  AddParts(bundle);
  return bundle;
}

// The length of a residual that corner noise and the robot's noise together explain.
double ExpectedError(const PoseNetwork& network, const BundleCorner& corner,
                     const RobotNoise& noise) {
  double robot = 0;
  if (corner.flange >= 0) {
    const Look& look = network.looks[corner.look];
    const Eigen::Isometry3d& board = *network.board_poses[look.board_pose].pose;
    const Eigen::Vector3d seen =
        *network.camera_poses[look.view] * network.LinkOf(look) * board * corner.point;
    const double lever = corner.camera_on_flange ? seen.norm() : (board * corner.point).norm();
    const double per_metre = network.views[look.view].lens.fx / std::max(1e-3, seen.z());
    robot = per_metre * std::hypot(noise.position_sigma, noise.rotation_sigma * lever);
  }
  return 1.18 * std::hypot(corner.sigma, robot);  // the median length of a plane normal vector
}

void FindMedians(const RobotNoise& noise, PoseFit& fit) {
  const size_t views = fit.network.views.size();
  std::vector<std::vector<double>> lengths(views);
  std::vector<std::vector<double>> expected(views);
  for (const BundleCorner& corner : fit.bundle.corners) {
    lengths[corner.camera].push_back(corner.residual.norm());
    expected[corner.camera].push_back(ExpectedError(fit.network, corner, noise));
  }
  for (size_t i = 0; i < views; ++i) {
    fit.median_px.push_back(MedianOrInfinity(std::move(lengths[i])));
    fit.expected_px.push_back(MedianOrInfinity(std::move(expected[i])));
  }
}

// Whether anything at all ties something to the robot's base.
bool HasBase(const PoseNetwork& network) {
  return std::ranges::any_of(network.looks, [&](const Look& look) {
    const int board = network.board_poses[look.board_pose].board;
    return look.flange >= 0 || network.boards[board].place == BoardPlace::kSurveyed;
  });
}

absl::Status NothingSaysWhereTheBaseIs(const PoseProblem& problem) {
  for (const PoseBoard& board : problem.boards) {
    if (board.place != BoardPlace::kFlange && board.place != BoardPlace::kSurveyed) continue;
    const bool on_flange = board.place == BoardPlace::kFlange;
    return FailedPrecondition(absl::StrCat(
        "nothing says where the robot's base is: no fixed view saw the ",
        on_flange ? "flange's" : "surveyed", " board '", board.board.description().name,
        "'; is it that board, and large enough in the images?"));
  }
  return FailedPrecondition(
      "nothing says where the robot's base is: only boards were seen whose place is not known; "
      "put one on the flange and give the robot's poses, or survey one");
}

}  // namespace

BundleCorner CornerOf(const PoseNetwork& network, size_t look, size_t place) {
  const Look& of = network.looks[look];
  const LookCorner& corner = of.corners[place];
  return {.camera = of.view,
          .flange = of.flange < 0 ? -1 : network.same_as[of.flange],
          .camera_on_flange = network.views[of.view].on_flange,
          .board_pose = of.board_pose,
          .size = network.board_poses[of.board_pose].board,
          .point = corner.point,
          .pixel = corner.pixel,
          .sigma = corner.sigma,
          .stated = corner.sigma,
          .sighting = corner.sighting,
          .look = look,
          .place = place};
}

bool AdjustStepwise(Bundle& bundle, double robust) {
  // The first residuals are those of the seeds: many sigmas, as the solver could not see else.
  double scale = 1e9;
  for (int i = 0; i < 8; ++i) {
    std::vector<double> sigmas;
    for (const BundleCorner& corner : bundle.corners) {
      if (corner.residual.allFinite()) sigmas.push_back(corner.residual.norm() / corner.sigma);
    }
    const double next = std::max(robust, 1.5 * MedianOrInfinity(std::move(sigmas)));
    if (i > 0 && next > 0.8 * scale) return true;
    scale = next;
    if (!Adjust(bundle, scale)) return false;
  }
  return true;
}

absl::StatusOr<PoseFit> FitWithExactRobot(const PoseProblem& problem) {
  ASSIGN_OR_RETURN(PoseNetwork network, NetworkOf(problem));
  if (!HasBase(network)) return NothingSaysWhereTheBaseIs(problem);
  FindCandidates(network);
  const std::vector<std::string> reasons = SeedPoses(network);
  if (!reasons.empty()) return FailedPrecondition(absl::StrJoin(reasons, "; "));
  PoseFit fit{.network = std::move(network), .bundle{}, .median_px{}, .expected_px{}};
  fit.bundle = BundleOf(fit.network, problem.robot_noise);
  fit.bundle.free_sizes = problem.size_trust == SizeTrust::kFound;
  FindResiduals(fit.bundle);
  // If it fails, the residuals stay large, and the checks find them.
  AdjustStepwise(fit.bundle, kRobust);
  FindMedians(problem.robot_noise, fit);
  return fit;
}

}  // namespace silhouette
