// SPDX-License-Identifier: Apache-2.0
// A made-up cell whose truth is known: cameras around a workspace of 1.5 m, boards, a robot that
// does not stand quite where it says, and corners with noise.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

inline constexpr double kRigDegree = 3.14159265358979323846 / 180;

// camera_from_base of a camera at `place` that looks at `at`; the base's z is up in the image.
inline Eigen::Isometry3d Looking(const Eigen::Vector3d& place, const Eigen::Vector3d& at) {
  const Eigen::Vector3d z = (at - place).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d base_from_camera;
  base_from_camera << x, z.cross(x), z;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = base_from_camera.transpose();
  pose.translation() = -pose.linear() * place;
  return pose;
}

class PoseRig {
 public:
  explicit PoseRig(unsigned seed, int cameras = 4) : random_(seed) {
    for (int i = 0; i < cameras; ++i) {
      const double around = (45 + 90 * i) * kRigDegree;
      const Eigen::Vector3d place(2.2 * std::cos(around), 2.2 * std::sin(around), 1.9);
      Add("camera" + std::to_string(i), Looking(place, {0, 0, 0.7}), false);
    }
  }

  double corner_sigma = 0.05;  // pixels
  // What the model does not know: by how much corners are printed elsewhere than described, metres,
  // and how the lenses really distort.
  double print_sigma = 0;
  std::optional<std::array<double, 8>> true_distortion;
  PoseProblem problem;
  std::vector<Eigen::Isometry3d> camera_poses;  // true ones, as in SolvedView
  std::vector<Eigen::Isometry3d> board_poses;   // true ones, of boards that are not loose

  double Normal(double sigma) { return std::normal_distribution<double>(0, sigma)(random_); }
  double Uniform(double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random_);
  }

  Eigen::Isometry3d SmallMotion(double position_sigma, double rotation_sigma) {
    const Eigen::Vector3d turn(Normal(rotation_sigma), Normal(rotation_sigma),
                               Normal(rotation_sigma));
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    if (turn.norm() > 0) {
      motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).matrix();
    }
    motion.translation() =
        Eigen::Vector3d(Normal(position_sigma), Normal(position_sigma), Normal(position_sigma));
    return motion;
  }

  void Add(const std::string& name, const Eigen::Isometry3d& pose, bool on_flange) {
    problem.views.push_back({.name = name,
                             .lens = {.width = 1280,
                                      .height = 960,
                                      .fx = 905,
                                      .fy = 907,
                                      .cx = 643,
                                      .cy = 475,
                                      .distortion = {-0.12, 0.03, 0.0005, -0.0004}},
                             .on_flange = on_flange});
    camera_poses.push_back(pose);
  }

  // `pose`: where the board really is, flange_from_board or base_from_board.
  void AddBoard(const std::string& name, BoardPlace place, const Eigen::Isometry3d& pose,
                double tag_size = 0.12, int rows = 1, int columns = 1) {
    PoseBoard board{.board = Board({.name = name,
                                    .rows = rows,
                                    .columns = columns,
                                    .tag_size = tag_size,
                                    .gap = rows * columns > 1 ? tag_size : 0.0,
                                    .first_id = next_tag_}),
                    .place = place};
    next_tag_ += rows * columns;
    if (place == BoardPlace::kSurveyed) {
      board.base_from_board = pose * SmallMotion(board.position_sigma, board.rotation_sigma);
    }
    problem.boards.push_back(board);
    board_poses.push_back(pose);
  }

  // The board on the flange as in all tests: a little aside, facing along the flange's z.
  void AddFlangeBoard(double tag_size = 0.12) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Eigen::Vector3d(0.02, -0.05, 0.08);
    pose.linear() = (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(3.14159265358979 - 0.1, Eigen::Vector3d::UnitX()))
                        .matrix();
    AddBoard("flange", BoardPlace::kFlange, pose, tag_size);
  }

  // Five floor tags that were surveyed.
  void AddFloorTags() {
    for (const auto& [x, y] :
         {std::pair(-0.7, -0.7), {0.7, -0.6}, {0.6, 0.7}, {-0.6, 0.6}, {0.0, 0.1}}) {
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.linear() = Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitX()).matrix();
      pose.translation() = Eigen::Vector3d(x, y, 0.2 * (1 + x));
      AddBoard("floor" + std::to_string(problem.boards.size()), BoardPlace::kSurveyed, pose, 0.15);
    }
  }

  // A flange pose in the workspace whose z axis looks at `at`, not exactly.
  Eigen::Isometry3d RandomFlange(const Eigen::Vector3d& at, double tilt = 25 * kRigDegree) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Eigen::Vector3d(Uniform(-0.6, 0.6), Uniform(-0.6, 0.6), Uniform(0.3, 1.2));
    const Eigen::Vector3d z = (at - pose.translation()).normalized();
    const Eigen::Vector3d x = z.unitOrthogonal();
    pose.linear() << x, z.cross(x), z;
    pose.linear() = (pose.linear() * Eigen::AngleAxisd(Uniform(-3, 3), Eigen::Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(Uniform(-tilt, tilt), Eigen::Vector3d::UnitX()) *
                     Eigen::AngleAxisd(Uniform(-tilt, tilt), Eigen::Vector3d::UnitY()))
                        .matrix();
    return pose;
  }

  // Frames whose flange looks up, a little towards one camera after the other, so that most views
  // see its board; and everything seen in them.
  void Drive(int frames) {
    for (int i = 0; i < frames; ++i) {
      const PoseView& view = problem.views[i % problem.views.size()];
      const Eigen::Vector3d at = view.on_flange
                                     ? Eigen::Vector3d(Uniform(-0.3, 0.3), Uniform(-0.3, 0.3), 0)
                                     : Eigen::Vector3d(Uniform(-1, 1), Uniform(-1, 1), 2.5);
      Take("frame" + std::to_string(1000 + i), RandomFlange(at));
    }
  }

  // One frame with the flange at `base_from_flange`, which the robot says with its noise.
  void Take(const std::string& frame, const Eigen::Isometry3d& base_from_flange) {
    const RobotNoise& noise = problem.robot_noise;
    problem.robot_poses.push_back(
        {frame, base_from_flange * SmallMotion(noise.position_sigma, noise.rotation_sigma)});
    for (size_t i = 0; i < problem.boards.size(); ++i) {
      if (problem.boards[i].place == BoardPlace::kLoose) continue;
      const bool moves = problem.boards[i].place == BoardPlace::kFlange;
      See(frame, i, moves ? base_from_flange * board_poses[i] : board_poses[i], base_from_flange);
    }
  }

  // The board is held into the cell, facing the cameras above, in so many frames of its own.
  void Hold(size_t board, int frames) {
    Eigen::Isometry3d over = Eigen::Isometry3d::Identity();
    over.linear() = Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitX()).matrix();
    for (int i = 0; i < frames; ++i) {
      Eigen::Isometry3d pose = over * SmallMotion(0.3, 0.2);
      pose.translation().z() = Uniform(0.3, 1.1);
      See("held" + std::to_string(i), board, pose);
    }
  }

  // What all views see of a board at `base_from_board`.
  void See(const std::string& frame, size_t board, const Eigen::Isometry3d& base_from_board,
           const Eigen::Isometry3d& base_from_flange = Eigen::Isometry3d::Identity()) {
    for (size_t view = 0; view < problem.views.size(); ++view) {
      Eigen::Isometry3d camera_from_base = camera_poses[view];
      if (problem.views[view].on_flange)
        camera_from_base = camera_from_base * base_from_flange.inverse();
      SeeBy(frame, view, board, camera_from_base * base_from_board);
    }
  }

 private:
  void SeeBy(const std::string& frame, size_t view, size_t board,
             const Eigen::Isometry3d& camera_from_board) {
    const Eigen::Vector3d ahead = camera_from_board.linear().col(2);
    const Board& shown = problem.boards[board].board;
    CameraIntrinsics lens = problem.views[view].lens;
    if (true_distortion) lens.distortion = *true_distortion;
    const CameraModel camera(lens, camera_from_board);
    for (int tag = shown.first_mark(); shown.HasTag(tag); ++tag) {
      TagSighting seen{.frame = frame,
                       .view = problem.views[view].name,
                       .family = shown.family(),
                       .tag = tag,
                       .sigma = corner_sigma};
      bool visible = true;
      for (const Eigen::Vector3d& point : shown.CornersOf(tag)) {
        const auto pixel =
            camera.Project(point + PrintError(tag, static_cast<int>(seen.corners.size())));
        visible = visible && pixel && camera.Contains(*pixel) &&
                  ahead.dot((camera_from_board * point).normalized()) > 0.35;
        if (!visible) break;
        seen.corners.push_back(*pixel +
                               Eigen::Vector2d(Normal(corner_sigma), Normal(corner_sigma)));
      }
      if (visible) problem.sightings.push_back(seen);
    }
  }

  Eigen::Vector3d PrintError(int tag, int corner) {
    if (print_sigma == 0) return Eigen::Vector3d::Zero();
    const auto [place, added] = print_errors_.try_emplace({tag, corner}, 0, 0, 0);
    if (added) place->second = {Normal(print_sigma), Normal(print_sigma), Normal(print_sigma)};
    return place->second;
  }

  std::mt19937 random_;
  int next_tag_ = 0;
  std::map<std::pair<int, int>, Eigen::Vector3d> print_errors_;
};

// A session with the board on the flange.
inline PoseRig FlangeRig(unsigned seed, int cameras = 4, int frames = 30) {
  PoseRig rig(seed, cameras);
  rig.AddFlangeBoard();
  rig.Drive(frames);
  return rig;
}

// A session with a board held into the cell too, which ties two views that never see the flange.
inline PoseRig HeldBoardRig(unsigned seed, int held_frames) {
  PoseRig rig(seed);
  rig.AddFlangeBoard();
  rig.AddBoard("held", BoardPlace::kLoose, Eigen::Isometry3d::Identity(), 0.06, 2, 2);
  rig.Drive(30);
  std::erase_if(rig.problem.sightings, [](const TagSighting& seen) {
    return seen.view == "camera2" || seen.view == "camera3";
  });
  rig.Hold(1, held_frames);
  return rig;
}

// The message of a refusal; empty if there is a solution.
inline std::string Refusal(const PoseProblem& problem) {
  return std::string(CalibratePoses(problem).status().message());
}

// What a solved pose is off: measured^-1 * true as rotation vector and translation.
inline Eigen::Matrix<double, 6, 1> PoseError(const Eigen::Isometry3d& solved,
                                             const Eigen::Isometry3d& truth) {
  const Eigen::Isometry3d motion = truth.inverse() * solved;
  const Eigen::AngleAxisd turn(motion.linear());
  Eigen::Matrix<double, 6, 1> error;
  error << turn.angle() * turn.axis(), motion.translation();
  return error;
}

}  // namespace silhouette
