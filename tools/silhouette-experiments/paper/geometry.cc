// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/geometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace silhouette::paper {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kParallel = 1e-9;

// x_b' F x_a = 0: either image shows how far a point is along the common normal of both directions.
Eigen::Matrix3d FundamentalBetween(const ParallelCamera& a, const ParallelCamera& b) {
  const Vector3d normal = a.direction().cross(b.direction());
  if (normal.norm() < kParallel) {
    throw std::invalid_argument("two cameras look along the same line");
  }
  const Vector3d n = normal.normalized();
  // n . P = line . (u, v, 1) in the image of each.
  const auto line = [&](const ParallelCamera& camera) {
    const double scale = camera.pixels_per_unit();
    const Vector2d origin = camera.Project(Vector3d::Zero());
    const double per_u = n.dot(camera.right()) / scale;
    const double per_v = -n.dot(camera.up()) / scale;
    return Vector3d(per_u, per_v, -per_u * origin.x() - per_v * origin.y());
  };
  const Vector3d line_a = line(a);
  const Vector3d line_b = line(b);
  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();
  f.row(2) = line_a.transpose();
  f(0, 2) -= line_b.x();
  f(1, 2) -= line_b.y();
  f(2, 2) -= line_b.z();
  return f;
}

}  // namespace

std::string NameOf(Variant variant) { return variant == Variant::kPlanar ? "planar" : "spatial"; }

Spheres ArmAt(const ArmShape& shape, Variant variant, double q1, double q2) {
  std::array<Vector3d, 2> directions;
  if (variant == Variant::kPlanar) {
    directions = {Vector3d(std::cos(q1), 0, std::sin(q1)),
                  Vector3d(std::cos(q1 + q2), 0, std::sin(q1 + q2))};
  } else {
    directions = {Vector3d(std::cos(q1), std::sin(q1), 0),
                  Vector3d(std::cos(q1) * std::cos(q2), std::sin(q1) * std::cos(q2), std::sin(q2))};
  }
  Spheres spheres;
  Vector3d start = Vector3d::Zero();
  for (size_t link = 0; link < directions.size(); ++link) {
    const Vector3d end = start + shape.links[link] * directions[link];
    for (int i = 0; i < shape.spheres_per_link; ++i) {
      const double share = static_cast<double>(i) / (shape.spheres_per_link - 1);
      spheres.push_back({start + share * (end - start), shape.sphere_radius});
    }
    start = end;
  }
  return spheres;
}

ConfigurationGrid ArmGrid(int steps) {
  const auto joint = [&](const char* name) {
    return GridJoint{name, 0, 2 * std::numbers::pi, steps, true};
  };
  return ConfigurationGrid({joint("q1"), joint("q2")});
}

ParallelCamera::ParallelCamera(const Vector3d& direction, double half_width, int pixels)
    : half_width_(half_width), pixels_(pixels) {
  if (!direction.allFinite() || direction.norm() == 0) {
    throw std::invalid_argument("a camera's direction must be a finite vector other than 0");
  }
  if (!(half_width > 0) || !MaskSize{pixels, pixels}.valid()) {
    throw std::invalid_argument("a camera's window and its pixels must be positive");
  }
  direction_ = direction.normalized();
  const bool vertical = direction_.cross(Vector3d::UnitZ()).norm() < kParallel;
  const Vector3d above = vertical ? Vector3d::UnitY() : Vector3d::UnitZ();
  right_ = direction_.cross(above).normalized();
  up_ = right_.cross(direction_);
}

Vector2d ParallelCamera::Project(const Vector3d& point) const {
  const double scale = pixels_per_unit();
  return {(point.dot(right_) + half_width_) * scale - 0.5,
          (half_width_ - point.dot(up_)) * scale - 0.5};
}

Calibration CalibrationOf(std::span<const ParallelCamera> cameras) {
  Calibration calibration;
  for (size_t a = 0; a < cameras.size(); ++a) {
    for (size_t b = a + 1; b < cameras.size(); ++b) {
      calibration.fundamental_matrices.push_back({.view_a = static_cast<int>(a),
                                                  .view_b = static_cast<int>(b),
                                                  .f = FundamentalBetween(cameras[a], cameras[b])});
    }
  }
  return calibration;
}

std::string NameOf(Raster raster) { return raster == Raster::kCentre ? "centre" : "touch"; }

Mask ImageOf(const ParallelCamera& camera, std::span<const Sphere> spheres, Raster raster) {
  const MaskSize size = camera.mask_size();
  // How far the part of a pixel that counts reaches from its centre.
  const double half = raster == Raster::kTouch ? 0.5 : 0.0;
  std::vector<uint64_t> words(size.words(), 0);
  for (const Sphere& sphere : spheres) {
    const Vector2d centre = camera.Project(sphere.centre);
    const double radius = sphere.radius * camera.pixels_per_unit();
    const double reach = radius + half;
    const int top = std::max(0, static_cast<int>(std::ceil(centre.y() - reach)));
    const int bottom = std::min(size.height - 1, static_cast<int>(std::floor(centre.y() + reach)));
    for (int y = top; y <= bottom; ++y) {
      const double off = std::max(0.0, std::abs(y - centre.y()) - half);
      const double squared = radius * radius - off * off;
      if (squared < 0) continue;
      const double wide = std::sqrt(squared) + half;
      const int left = std::max(0, static_cast<int>(std::ceil(centre.x() - wide)));
      const int right = std::min(size.width - 1, static_cast<int>(std::floor(centre.x() + wide)));
      for (int x = left; x <= right; ++x) {
        const auto bit = static_cast<size_t>(y * size.width + x);
        words[bit / 64] |= uint64_t{1} << (bit % 64);
      }
    }
  }
  return Mask::FromWords(size, std::move(words));
}

}  // namespace silhouette::paper
