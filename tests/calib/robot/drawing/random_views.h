// SPDX-License-Identifier: Apache-2.0
// Random cameras, and points of bodies, for tests of drawn masks.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "calib/camera/camera_model.h"
#include "calib/robot/triangle_mesh.h"
#include "db/mask/mask.h"

namespace silhouette {

template <typename Generator>
double Uniform(Generator& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

template <typename Generator>
Eigen::Vector3d RandomDirection(Generator& random) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
}

template <typename Generator>
Eigen::Isometry3d RandomPose(Generator& random, const Eigen::Vector3d& at) {
  return Eigen::Translation3d(at) *
         Eigen::AngleAxisd(Uniform(random, 0, 3.1), RandomDirection(random));
}

template <typename Generator>
MaskSize RandomMaskSize(Generator& random) {
  constexpr MaskSize kSizes[] = {{64, 64}, {128, 96}, {63, 41}, {320, 240}};
  return kSizes[random() % 4];
}

// From 35 to 110 degrees wide, straight, barrel, cushion or rational; one in twelve so strong that
// it folds within the image.
template <typename Generator>
CameraModel RandomCamera(Generator& random, const Eigen::Isometry3d& camera_from_world) {
  CameraIntrinsics in{.width = 1280, .height = 960};
  in.fx = 640 / std::tan(Uniform(random, 0.3, 0.95));
  in.fy = in.fx * Uniform(random, 0.98, 1.02);
  in.cx = 639.5 + Uniform(random, -60, 60);
  in.cy = 479.5 + Uniform(random, -60, 60);
  switch (random() % 4) {
    case 0:
      break;
    case 1:
      in.distortion = {Uniform(random, -0.25, 0), Uniform(random, 0, 0.08), 0, 0, 0};
      break;
    case 2:
      in.distortion = {Uniform(random, -0.05, 0.2), Uniform(random, 0, 0.1), 0.002, -0.003, 0};
      break;
    default:
      in.distortion = {Uniform(random, -0.2, 0.3), Uniform(random, 0, 0.1), 0.001, -0.002, 0.01,
                       Uniform(random, 0, 0.3),    Uniform(random, 0, 0.1), 0.01};
  }
  if (random() % 12 == 0) in.distortion = {-0.55, 0, 0, 0, 0};
  return {in, camera_from_world};
}

// A random point of the surface.
template <typename Generator>
Eigen::Vector3d SurfacePoint(Generator& random, const TriangleMesh& mesh) {
  const auto& corners = mesh.triangles[random() % mesh.triangles.size()];
  double a = Uniform(random, 0, 1);
  double b = Uniform(random, 0, 1);
  if (a + b > 1) {
    a = 1 - a;
    b = 1 - b;
  }
  // Edges and corners are where silhouettes are.
  switch (random() % 4) {
    case 0:
      b = 0;
      break;
    case 1:
      a = b = 0;
      break;
    default:
      break;
  }
  return (1 - a - b) * mesh.vertices[corners[0]] + a * mesh.vertices[corners[1]] +
         b * mesh.vertices[corners[2]];
}

inline Eigen::Matrix3Xd PointsOf(const TriangleMesh& mesh) {
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(mesh.vertices.size()));
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    points.col(static_cast<Eigen::Index>(i)) = mesh.vertices[i];
  }
  return points;
}

}  // namespace silhouette
