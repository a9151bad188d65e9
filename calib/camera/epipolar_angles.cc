// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/epipolar_angles.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

namespace silhouette {
namespace {

constexpr double kPi = std::numbers::pi;

// Where a plane of the pencil lies: its angle is that of this vector.
using Direction = std::optional<Eigen::Vector2d>;

// The square's corners and the middles of its edges, in order around the pixel's centre.
std::array<Eigen::Vector2d, 8> Rim(int x, int y, double half) {
  return {Eigen::Vector2d(x - half, y - half), Eigen::Vector2d(x, y - half),
          Eigen::Vector2d(x + half, y - half), Eigen::Vector2d(x + half, y),
          Eigen::Vector2d(x + half, y + half), Eigen::Vector2d(x, y + half),
          Eigen::Vector2d(x - half, y + half), Eigen::Vector2d(x - half, y)};
}

// The angles along the rim of a pixel's square. Going once round an epipole turns the direction by
// a whole turn; otherwise it comes back to where it began.
template <typename DirectionAt>
AngleInterval IntervalIn(int x, int y, double half, double period, const DirectionAt& at) {
  const AngleInterval everything{0, period};
  double angle = 0;
  double least = 0;
  double greatest = 0;
  Direction first;
  Direction last;
  const auto turn_to = [&](const Eigen::Vector2d& next) {
    angle += std::atan2(last->x() * next.y() - last->y() * next.x(), last->dot(next));
    least = std::min(least, angle);
    greatest = std::max(greatest, angle);
    last = next;
  };
  for (const Eigen::Vector2d& point : Rim(x, y, half)) {
    const Direction next = at(point);
    if (!next || !(next->norm() > 0)) return everything;
    if (first) {
      turn_to(*next);
    } else {
      first = last = next;
    }
  }
  turn_to(*first);
  if (std::abs(angle) > kPi || greatest - least >= period) return everything;
  const double start = std::atan2(first->y(), first->x()) + least;
  const double from = start - period * std::floor(start / period);
  return {from, from + greatest - least};
}

template <typename DirectionAt>
std::vector<AngleInterval> Intervals(PixelSize size, double margin, double period,
                                     const DirectionAt& at) {
  std::vector<AngleInterval> intervals;
  intervals.reserve(static_cast<size_t>(size.width) * static_cast<size_t>(size.height));
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      intervals.push_back(IntervalIn(x, y, 0.5 + margin, period, at));
    }
  }
  return intervals;
}

void RequireMargin(double margin) {
  if (!(margin >= 0) || !std::isfinite(margin)) {
    throw std::invalid_argument("the margin of the calibration must not be negative");
  }
}

// Takes pixels of an image to coordinates of about 1, for a well-conditioned decomposition.
Eigen::Matrix3d PixelFromNormal(PixelSize size) {
  const double scale = 0.5 * std::max(size.width, size.height);
  Eigen::Matrix3d matrix;
  matrix << scale, 0, 0.5 * (size.width - 1), 0, scale, 0.5 * (size.height - 1), 0, 0, 1;
  return matrix;
}

}  // namespace

EpipolarAngles AnglesBetween(const CameraModel& a, const CameraModel& b, double margin) {
  RequireMargin(margin);
  const Eigen::Vector3d axis = b.Centre() - a.Centre();
  if (!(axis.norm() > 1e-9)) {
    throw std::invalid_argument("two cameras stand at the same place");
  }
  const Eigen::Vector3d along = axis.normalized();
  const Eigen::Vector3d u = along.unitOrthogonal();
  const Eigen::Vector3d v = along.cross(u);
  const auto intervals = [&](const CameraModel& camera) {
    const PixelSize size{camera.intrinsics().width, camera.intrinsics().height};
    return Intervals(size, margin, 2 * kPi, [&](const Eigen::Vector2d& point) -> Direction {
      const std::optional<Eigen::Vector3d> ray = camera.Ray(point);
      if (!ray) return std::nullopt;
      return Eigen::Vector2d(ray->dot(u), ray->dot(v));
    });
  };
  return {2 * kPi, intervals(a), intervals(b)};
}

EpipolarAngles AnglesBetween(const Eigen::Matrix3d& f, PixelSize size_a, PixelSize size_b,
                             double margin) {
  RequireMargin(margin);
  if (size_a.width <= 0 || size_a.height <= 0 || size_b.width <= 0 || size_b.height <= 0) {
    throw std::invalid_argument("an image has no pixels");
  }
  if (!f.allFinite()) throw std::invalid_argument("a fundamental matrix must be finite");
  const Eigen::Matrix3d pixel_from_a = PixelFromNormal(size_a);
  const Eigen::Matrix3d pixel_from_b = PixelFromNormal(size_b);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(pixel_from_b.transpose() * f * pixel_from_a,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& s = svd.singularValues();
  if (!(s[1] > 1e-9 * s[0]) || !(s[2] < 1e-2 * s[1])) {
    throw std::invalid_argument("a fundamental matrix must be of rank 2");
  }
  // The line of a point of `a` is alpha u_1 + beta u_2; alpha and beta, each scaled, are a
  // direction that the points on that line in `b` share.
  const Eigen::Vector2d scale(std::sqrt(s[0]), std::sqrt(s[1]));
  Eigen::Matrix<double, 2, 3> of_a;
  of_a << scale[0] * svd.matrixV().col(0).transpose(), scale[1] * svd.matrixV().col(1).transpose();
  Eigen::Matrix<double, 2, 3> of_b;
  of_b << -scale[1] * svd.matrixU().col(1).transpose(), scale[0] * svd.matrixU().col(0).transpose();
  const auto intervals = [&](PixelSize size, const Eigen::Matrix<double, 2, 3>& normal) {
    return Intervals(size, margin, kPi, [&](const Eigen::Vector2d& point) -> Direction {
      return Eigen::Vector2d(normal * point.homogeneous());
    });
  };
  return {kPi, intervals(size_a, of_a * pixel_from_a.inverse()),
          intervals(size_b, of_b * pixel_from_b.inverse())};
}

}  // namespace silhouette
