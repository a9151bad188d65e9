// SPDX-License-Identifier: Apache-2.0
// PoseNetwork: the problem as looks - one board in one image - between poses that are to be found.
//
// Every look says: camera_pose * link * board_pose = camera_from_board, where `link` is the
// identity, the flange's pose (board on the flange) or its inverse (camera on the flange).
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/camera_model.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

struct LookCorner {
  Eigen::Vector3d point;  // in the board's frame
  Eigen::Vector2d pixel;
  double sigma = 0;
  size_t sighting = 0;  // in the problem
  int corner = 0;
};

struct Look {
  int view = 0;
  int board_pose = 0;
  int flange = -1;  // index of the robot pose; -1: the look does not depend on it
  std::string frame;
  std::vector<LookCorner> corners;
  // What the look alone says of camera_from_board, the likelier first; at most two.
  std::vector<Eigen::Isometry3d> candidates;
};

// A board's pose: one for a board that is fixed to something, one a frame for a loose board.
struct BoardPose {
  int board = 0;
  std::optional<Eigen::Isometry3d> pose;  // flange_from_board or base_from_board
};

struct PoseNetwork {
  std::vector<PoseView> views;
  std::vector<CameraModel> lenses;  // one per view, with the identity as pose
  std::vector<PoseBoard> boards;
  std::vector<RobotPose> robot_poses;
  // Of each robot pose the first one that is the same, with nothing moved in the images: they share
  // one error.
  std::vector<int> same_as;
  std::vector<std::optional<Eigen::Isometry3d>> camera_poses;  // one per view
  std::vector<BoardPose> board_poses;
  std::vector<Look> looks;
  std::vector<std::string> warnings;

  // `link` of a look, with the flange where the robot says.
  Eigen::Isometry3d LinkOf(const Look& look) const;
};

// Checks the problem and sorts it; surveyed boards have their pose, all else none. Looks that
// cannot be used (no pose of the robot for the frame) are left out with a warning. Errors:
// InvalidArgument as CalibratePoses, FailedPrecondition for mirrored images and frames of which
// none has a pose of the robot.
absl::StatusOr<PoseNetwork> NetworkOf(const PoseProblem& problem);

// Corners of a look's board at `camera_from_board`: the median distance to where they were seen,
// pixels; infinity if one is not visible from there. `lens`: with the identity as pose.
double MedianError(const CameraModel& lens, const Look& look,
                   const Eigen::Isometry3d& camera_from_board);

// First values for all poses of a network.

// Fills Look::candidates; a look that no pose explains (fewer than four usable corners, corners
// beyond the lens's fold) stays without.
void FindCandidates(PoseNetwork& network);

// Fills camera_poses and board_poses as far as they are connected: from known boards to views and
// back, and by hand-eye calibration where neither is known. Returns why views that did not get a
// pose have none, one sentence each; empty if all have one.
std::vector<std::string> SeedPoses(PoseNetwork& network);

// Whether two poses of the robot are one and the same, within the standard deviations of `noise`.
bool IsSamePose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, const RobotNoise& noise);

// Robot-world/hand-eye calibration in closed form: camera_pose * link_i * board_pose = seen_i.

struct HandEye {
  Eigen::Isometry3d camera_pose = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d board_pose = Eigen::Isometry3d::Identity();
  double median_px = 0;  // over the looks: how far corners are from where they were seen
  // The board's size by the robot's motion, as a multiple of what was said.
  double size = 1;
};

struct LinkedLook {
  const Look* look = nullptr;  // with candidates
  Eigen::Isometry3d link = Eigen::Isometry3d::Identity();
};

// camera_pose by Park's method; nothing if it finds none.
std::optional<Eigen::Isometry3d> CameraPoseByPark(std::span<const Eigen::Isometry3d> links,
                                                  std::span<const Eigen::Isometry3d> seen);

// The mean of what the pairs then say of board_pose.
Eigen::Isometry3d BoardPoseBy(const Eigen::Isometry3d& camera_pose,
                              std::span<const Eigen::Isometry3d> links,
                              std::span<const Eigen::Isometry3d> seen);

// FailedPrecondition, as the end of a sentence about the view, if the links hardly turn against
// each other, or about one axis only.
absl::Status CheckTurns(std::span<const Eigen::Isometry3d> links);

// By Park's method on samples of three looks, so that wrong candidates and single wrong poses do no
// harm. `lens`: with the identity as pose. The same looks give the same result. FailedPrecondition:
// fewer than three looks, or the flange turned about one axis only; the message is the end of a
// sentence about the view.
absl::StatusOr<HandEye> SolveHandEye(const CameraModel& lens, const std::vector<LinkedLook>& looks);

}  // namespace silhouette
