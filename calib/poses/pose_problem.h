// SPDX-License-Identifier: Apache-2.0
// What is known before the cameras' poses are: lenses, boards, what was seen of them, and where the
// robot stood.
//
// A pose `a_from_b` takes points in b to points in a. `base` is the robot's base frame, `flange`
// that of the link that carries the board or the camera. Metres, radians, pixels.
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/camera/camera_model.h"
#include "calib/camera/lens_region.h"

namespace silhouette {

inline constexpr double kDegree = std::numbers::pi / 180;  // radians

// Metres. A flange that is farther from the robot's base has its position in millimetres.
inline constexpr double kFarthestFlange = 50;

struct PoseView {
  std::string name;
  CameraIntrinsics lens;                           // held fixed
  bool on_flange = false;                          // eye-in-hand: the camera rides on the flange
  std::optional<LensRegion> known = std::nullopt;  // where the lens is
};

enum class BoardPlace {
  kLoose,     // anywhere, in every frame elsewhere: ties views that see it at once
  kFlange,    // fixed to the flange, it is not known where
  kStanding,  // stands still in the cell through all frames, it is not known where
  kSurveyed,  // stands still in the cell, and was measured
};

struct PoseBoard {
  Board board;
  BoardPlace place = BoardPlace::kLoose;
  // Where it is by the survey, and the survey's standard deviations, per axis; kSurveyed only.
  Eigen::Isometry3d base_from_board = Eigen::Isometry3d::Identity();
  double position_sigma = 1e-3;
  double rotation_sigma = 1e-2;
};

// Where the robot says that its flange was when a frame was taken.
struct RobotPose {
  std::string frame;
  Eigen::Isometry3d base_from_flange = Eigen::Isometry3d::Identity();
};

// Errors of the robot's reported poses: standard deviations per axis.
struct RobotNoise {
  double position_sigma = 0.2e-3;
  double rotation_sigma = 0.02 * kDegree;
};

// What counts where a board's stated size and the robot's motion, or the survey, contradict each
// other.
enum class SizeTrust {
  kNeither,  // it is refused; less than 1 % is found with all else
  kStated,   // the board's description
  kFound,    // the motion: the board's size is found with all else
};

struct PoseProblem {
  std::vector<PoseView> views;
  std::vector<PoseBoard> boards;
  std::vector<TagSighting> sightings;
  std::vector<RobotPose> robot_poses;  // in the order in which they were driven to
  RobotNoise robot_noise;
  bool robot_exact = false;  // takes the robot at its word; for comparison only
  // The least number of the robot's poses that may hold the cameras, where no survey does.
  int least_frames = 6;
  SizeTrust size_trust = SizeTrust::kNeither;
  // Points of the robot's workspace in the base, metres. None: it is not known.
  std::vector<Eigen::Vector3d> workspace;
  // Poses are found in spite of lenses that do not fit, or are not known where they are needed, of
  // things that moved meanwhile, and of boards whose size nothing checks.
  bool accept_doubts = false;
  std::vector<std::string> warnings;  // of those who read it; the solution has them, too
  // Called before each step of long work, with its name.
  std::function<void(const std::string&)> step = [](const std::string&) {};
};

// What is wrong with a problem before anything is solved.

// InvalidArgument: a name or a tag is there twice, a view is not there, a number is none or not
// positive. FailedPrecondition: nothing was seen, positions in millimetres, mirrored images.
absl::Status CheckProblem(const PoseProblem& problem);

// InvalidArgument, with the mend: the board is ambiguous, so that poses cannot be found from it.
absl::Status CheckFrameIsCertain(const Board& board);

// "a, b, c and 4 more".
std::string FewOf(const std::vector<std::string>& names);

}  // namespace silhouette
