// SPDX-License-Identifier: Apache-2.0
// Cameras around a workspace, and boards held into it, for tests: what they would see, seeded.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/camera/camera_model.h"
#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

inline Board LatticeBoard(const std::string& name = "board", int first_id = 0) {
  return Board(
      {.name = name, .rows = 3, .columns = 4, .tag_size = 0.08, .gap = 0.08, .first_id = first_id});
}

// Cameras of 1280 x 960 pixels on an arc, 1.3 m from the middle of the workspace (the origin), each
// with a lens of its own.
inline std::vector<CameraModel> CamerasOnAnArc(int count) {
  std::vector<CameraModel> cameras;
  for (int i = 0; i < count; ++i) {
    const CameraIntrinsics intrinsics{
        .width = 1280,
        .height = 960,
        .fx = 905 + 12.0 * i,
        .fy = 902 + 11.0 * i,
        .cx = 645 - 6.0 * i,
        .cy = 470 + 5.0 * i,
        .distortion = {-0.20 + 0.01 * i, 0.08, 0.0005, -0.0004, -0.01, 0, 0, 0}};
    const double turn = (i - (count - 1) / 2.0) * 0.5;
    const Eigen::Vector3d centre(1.3 * std::sin(turn), -0.3 + 0.1 * i, -1.3 * std::cos(turn));
    const Eigen::Vector3d z = -centre.normalized();
    const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
    world_from_camera.linear() << x, z.cross(x), z;
    world_from_camera.translation() = centre;
    cameras.emplace_back(intrinsics, world_from_camera.inverse());
  }
  return cameras;
}

inline std::string CameraName(size_t i) { return "cam" + std::to_string(i); }

inline std::vector<LensCamera> LensCamerasOf(const std::vector<CameraModel>& cameras) {
  std::vector<LensCamera> result;
  for (size_t i = 0; i < cameras.size(); ++i) {
    result.push_back({.name = CameraName(i),
                      .width = cameras[i].intrinsics().width,
                      .height = cameras[i].intrinsics().height});
  }
  return result;
}

struct BoardMotion {
  int frames = 40;
  double tilt = 40;     // degrees at most
  double spread = 0.7;  // metres at most to left and right; less up and down, and in depth
  double noise = 0.1;   // pixels per axis
};

// The pose of the board's frame in the world, its middle near the origin, facing the cameras.
inline Eigen::Isometry3d RandomBoardPose(std::mt19937& random, const Board& board,
                                         const BoardMotion& motion) {
  std::uniform_real_distribution<double> unit(-1, 1);
  const double most = motion.tilt * std::numbers::pi / 180;
  const Eigen::Vector3d middle(board.extent().x() / 2, board.extent().y() / 2, 0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() =
      motion.spread * Eigen::Vector3d(unit(random), 0.75 * unit(random), 0.4 * unit(random));
  pose.rotate(Eigen::AngleAxisd(most * unit(random), Eigen::Vector3d::UnitX()));
  pose.rotate(Eigen::AngleAxisd(most * unit(random), Eigen::Vector3d::UnitY()));
  pose.rotate(Eigen::AngleAxisd(most * unit(random), Eigen::Vector3d::UnitZ()));
  return pose * Eigen::Translation3d(-middle);
}

inline std::string FrameName(int frame) {
  return "frame" + std::string(frame < 10 ? "00" : frame < 100 ? "0" : "") + std::to_string(frame);
}

// Adds what the cameras see of a board that stands at `pose`. `height` bends the board: how far a
// point of it stands out, along the board's z.
inline void AddSightings(const std::vector<CameraModel>& cameras, const Board& board,
                         const Eigen::Isometry3d& pose, const std::string& frame, double noise,
                         std::mt19937& random, std::vector<TagSighting>& out,
                         const std::function<double(const Eigen::Vector3d&)>& height = {}) {
  std::normal_distribution<double> normal(0, 1);
  for (size_t c = 0; c < cameras.size(); ++c) {
    for (int id = board.first_mark(); board.HasTag(id); ++id) {
      TagSighting sighting{.frame = frame,
                           .view = CameraName(c),
                           .family = board.family(),
                           .tag = id,
                           .sigma = noise > 0 ? noise : 0.1};
      bool seen = true;
      const MarkCorners corners = board.CornersOf(id);
      for (Eigen::Vector3d corner : corners) {
        if (height) corner.z() += height(corner);
        const auto pixel = cameras[c].Project(pose * corner);
        const Eigen::Vector2d error(noise * normal(random), noise * normal(random));
        seen = seen && pixel && cameras[c].Contains(*pixel + error);
        if (seen) sighting.corners.push_back(*pixel + error);
      }
      if (seen) out.push_back(sighting);
    }
  }
}

inline std::vector<TagSighting> SightingsOf(const std::vector<CameraModel>& cameras,
                                            const Board& board, const BoardMotion& motion,
                                            std::mt19937& random) {
  std::vector<TagSighting> sightings;
  for (int frame = 0; frame < motion.frames; ++frame) {
    AddSightings(cameras, board, RandomBoardPose(random, board, motion), FrameName(frame),
                 motion.noise, random, sightings);
  }
  return sightings;
}

}  // namespace silhouette
