// PoseNetwork: the problem as looks - one board in one image - between poses that are to be found.
//
// Every look says: camera_pose * link * board_pose = camera_from_board, where `link` is the
// identity, the flange's pose (board on the flange) or its inverse (camera on the flange).
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
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

}  // namespace silhouette
