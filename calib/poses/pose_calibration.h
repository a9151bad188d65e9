// SPDX-License-Identifier: Apache-2.0
// Camera poses in the robot's base frame, from all that is known at once: boards on the flange,
// surveyed boards, boards that several views see in one frame, and cameras on the flange.
//
// Seeds come from each board's pose in the camera's frame (IPPE, both solutions) and Park's method
// for robot-world/hand-eye; then a bundle over all corners in pixels in which every flange pose
// has the robot's noise, every surveyed board the survey's, and outliers are reported by frame.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

// Of a small motion (rotation vector, translation) of the frame on a pose's right-hand side: of
// base for camera_from_base. Order: rotation (3), translation (3).
using PoseCovariance = Eigen::Matrix<double, 6, 6>;

struct SolvedView {
  std::string name;
  bool on_flange = false;
  // camera_from_base; of a view on the flange camera_from_flange.
  Eigen::Isometry3d camera_pose = Eigen::Isometry3d::Identity();
  PoseCovariance covariance = PoseCovariance::Zero();
  int corners = 0;      // that decided the pose
  int outliers = 0;     // corners that were left out
  double rms_px = 0;    // of a corner's residual per axis, without outliers
  double worst_px = 0;  // longest residual of a corner, without outliers
  // Of the view's pose alone: how far off points are where boards were seen, metres (PointSigma).
  double workspace_sigma = 0;        // root mean square
  double workspace_sigma_worst = 0;  // the largest
};

struct SolvedBoard {
  std::string name;
  BoardPlace place = BoardPlace::kLoose;  // never kLoose: those have a pose in every frame
  // flange_from_board for kFlange, else base_from_board.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  PoseCovariance covariance = PoseCovariance::Zero();
  // By how much a surveyed board stands elsewhere than was said: metres and radians.
  double survey_offset = 0;
  double survey_rotation = 0;
  bool survey_outlier = false;  // the survey of this board was left out
  double size = 1;              // of what was stated; see SizeTrust::kFound
};

struct SolvedFrame {
  std::string name;
  int corners = 0;   // without outliers
  int outliers = 0;  // corners
  double rms_px = 0;
  // By how much the flange stood elsewhere than the robot said: metres and radians.
  double robot_offset = 0;
  double robot_rotation = 0;
  bool robot_outlier = false;  // the robot's pose was left out
};

struct CornerResidual {
  size_t sighting = 0;  // in PoseProblem::sightings
  int corner = 0;
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // computed minus seen, pixels
  bool outlier = false;
};

// How far off one board's corners are in one view, root mean square per axis, pixels: by what the
// sightings state, which is the detection's share, and by the residuals.
struct SolvedNoise {
  std::string view;
  std::string board;
  double stated = 0;
  double sigma = 0;
};

struct PoseSolution {
  std::vector<SolvedView> views;    // in the order of the problem's
  std::vector<SolvedBoard> boards;  // those that were seen
  std::vector<SolvedFrame> frames;  // in the order of the sightings
  std::vector<CornerResidual> residuals;
  std::vector<SolvedNoise> noise;
  double chi2_per_dof = 0;  // with the stated sigmas of robot and survey
  int dof = 0;
  // How many times the stated sigma the errors look: of the corners, of the robot and of the survey
  // (0 where there is none). Covariances are by the corners' noise as it is, and enlarged by what
  // exceeds 1 of the robot's and the survey's.
  double image_noise_factor = 0;
  double robot_noise_factor = 0;
  double survey_noise_factor = 0;
  std::vector<std::string> warnings;  // one sentence each
  // Of the warnings, those for which the poses are refused without PoseProblem::accept_doubts.
  std::vector<std::string> doubts;
};

// The standard deviation of where a camera with this covariance takes a point of its world (base,
// or flange) to be: of the length of the error, metres.
double PointSigma(const PoseCovariance& covariance, const Eigen::Vector3d& point);

// A sentence if points of the workspace may be off by more than 3 mm (1 sigma); else empty.
std::string WeaknessOf(const SolvedView& view);

// InvalidArgument: the problem is wrong in itself: names or tags twice, a view that is not there.
// FailedPrecondition: the data do not determine the poses or contradict each other; the message
// says why, and what would mend it: too few poses, rotations about one axis only, no base frame,
// views without connection (named), another tag size, poses shifted by one frame, in millimetres,
// inverted or with quaternions in another order, mirrored boards, a lens that does not fit, a
// camera or a board that moved meanwhile, a lens that is not known where it shows the workspace, a
// board whose size nothing checks.
absl::StatusOr<PoseSolution> CalibratePoses(const PoseProblem& problem);

}  // namespace silhouette
