// SPDX-License-Identifier: Apache-2.0
// Cameras around a cell, and what they see of a board that is carried through it.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "capture/sim/tag_projection.h"

namespace silhouette {

inline CameraModel LookingAt(const CameraIntrinsics& intrinsics, const Eigen::Vector3d& from,
                             const Eigen::Vector3d& at) {
  Eigen::Isometry3d camera_from_world = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d ahead = (at - from).normalized();
  const Eigen::Vector3d right = ahead.cross(Eigen::Vector3d::UnitZ()).normalized();
  camera_from_world.linear().row(0) = right;
  camera_from_world.linear().row(1) = ahead.cross(right);
  camera_from_world.linear().row(2) = ahead;
  camera_from_world.translation() = -camera_from_world.linear() * from;
  return CameraModel(intrinsics, camera_from_world);
}

// Four cameras of 640 x 480 on one side of a cell, 45 degrees from one to the next.
inline std::vector<NamedCamera> CellCameras(double k1 = 0) {
  std::vector<NamedCamera> cameras;
  const std::array<std::string, 4> names = {"north", "east", "south", "west"};
  for (size_t i = 0; i < names.size(); ++i) {
    const double turn = 0.4 + 0.8 * static_cast<double>(i);
    const CameraIntrinsics intrinsics{.width = 640,
                                      .height = 480,
                                      .fx = 520 + 7.0 * static_cast<double>(i),
                                      .fy = 523,
                                      .cx = 316,
                                      .cy = 244,
                                      .distortion = {k1}};
    cameras.push_back({names[i], LookingAt(intrinsics,
                                           {3 * std::cos(turn), 3 * std::sin(turn),
                                            2.3 - 0.2 * static_cast<double>(i)},
                                           {0.1, 0, 0.9})});
  }
  return cameras;
}

inline ViewSizes SizesOf(const CameraModel& camera, int mask = 64) {
  return {.image = {camera.intrinsics().width, camera.intrinsics().height}, .mask = {mask, mask}};
}

// A board of 4 x 6 tags of 8 cm, anywhere in the cell.
inline BoardFrames CarriedBoard(const std::vector<NamedCamera>& cameras, size_t frames,
                                uint64_t seed, double sigma = 0.03, double reach = 1.1) {
  const Board board({.name = "board", .rows = 4, .columns = 6, .tag_size = 0.08, .gap = 0.08});
  return DrawBoardFrames(cameras, board,
                         {.volume = {Eigen::Vector3d(-reach, -reach, 0.9 - 0.7 * reach),
                                     Eigen::Vector3d(reach, reach, 0.9 + 0.8 * reach)},
                          .tilt = 0.8,
                          .least_views = 2},
                         frames, {.sigma = sigma, .least_size = 8, .most_tilt = 1.2, .border = 2},
                         seed);
}

}  // namespace silhouette
