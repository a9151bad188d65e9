// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/epipolar_geometry.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace silhouette {
namespace {

Eigen::Matrix3d PixelFromRay(const CameraIntrinsics& intrinsics) {
  Eigen::Matrix3d k;
  k << intrinsics.fx, 0, intrinsics.cx, 0, intrinsics.fy, intrinsics.cy, 0, 0, 1;
  return k;
}

Eigen::Matrix3d CrossWith(const Eigen::Vector3d& t) {
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  return cross;
}

// Takes pixel coordinates of an image of size `to` to those of one of size `from`.
Eigen::Matrix3d Scaling(PixelSize from, PixelSize to) {
  const double sx = static_cast<double>(from.width) / to.width;
  const double sy = static_cast<double>(from.height) / to.height;
  Eigen::Matrix3d scaling;
  scaling << sx, 0, 0.5 * sx - 0.5, 0, sy, 0.5 * sy - 0.5, 0, 0, 1;
  return scaling;
}

// From -0.5 to the other rim.
double PlaceOf(int step, int pixels, int steps) {
  return -0.5 + static_cast<double>(step) * pixels / steps;
}

// x_b' F x_a, and how steeply it grows in each image.
struct Algebraic {
  double error = 0;
  double slope_a = 0;
  double slope_b = 0;
};

Algebraic AlgebraicError(const Eigen::Matrix3d& f, const Eigen::Vector2d& a,
                         const Eigen::Vector2d& b) {
  const Eigen::Vector3d line_in_b = f * a.homogeneous();
  const Eigen::Vector3d line_in_a = f.transpose() * b.homogeneous();
  return {.error = line_in_b.dot(b.homogeneous()),
          .slope_a = line_in_a.head<2>().norm(),
          .slope_b = line_in_b.head<2>().norm()};
}

}  // namespace

Eigen::Matrix3d FundamentalBetween(const CameraModel& a, const CameraModel& b) {
  const Eigen::Isometry3d b_from_a = b.camera_from_world() * a.camera_from_world().inverse();
  if (!(b_from_a.translation().norm() > 1e-9)) {
    throw std::invalid_argument("two cameras stand at the same place");
  }
  const Eigen::Matrix3d f = PixelFromRay(b.intrinsics()).inverse().transpose() *
                            CrossWith(b_from_a.translation()) * b_from_a.linear() *
                            PixelFromRay(a.intrinsics()).inverse();
  return f / f.norm();
}

Eigen::Matrix3d ScaledTo(const Eigen::Matrix3d& f, PixelSize from_a, PixelSize to_a,
                         PixelSize from_b, PixelSize to_b) {
  return Scaling(from_b, to_b).transpose() * f * Scaling(from_a, to_a);
}

Eigen::Vector2d ScaledTo(const Eigen::Vector2d& point, PixelSize from, PixelSize to) {
  return {(point.x() + 0.5) * to.width / from.width - 0.5,
          (point.y() + 0.5) * to.height / from.height - 0.5};
}

bool Contains(PixelSize image, const Eigen::Vector2d& pixel) {
  return pixel.x() >= -0.5 && pixel.x() <= image.width - 0.5 && pixel.y() >= -0.5 &&
         pixel.y() <= image.height - 0.5;
}

std::vector<Eigen::Vector2d> PointsAllOver(PixelSize image, int steps) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      points.emplace_back(PlaceOf(i, image.width, steps), PlaceOf(j, image.height, steps));
    }
  }
  return points;
}

std::vector<Eigen::Vector2d> PointsOnLine(const Eigen::Vector3d& line, PixelSize image, int steps) {
  const bool steep = std::abs(line.x()) * image.height > std::abs(line.y()) * image.width;
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i <= steps; ++i) {
    const double along = PlaceOf(i, steep ? image.height : image.width, steps);
    if (steep) {
      points.emplace_back(-(line.y() * along + line.z()) / line.x(), along);
    } else {
      points.emplace_back(along, -(line.x() * along + line.z()) / line.y());
    }
  }
  return points;
}

EpipolarDistance DistanceBetween(const Eigen::Matrix3d& f, const Eigen::Vector2d& a,
                                 const Eigen::Vector2d& b) {
  const Algebraic at = AlgebraicError(f, a, b);
  return {.in_a = std::abs(at.error) / at.slope_a, .in_b = std::abs(at.error) / at.slope_b};
}

// A margin m widens the angles of the squares by m times the angle per pixel, which is a slope
// times the same factor in both images; together they must make up for the error.
double NeededMargin(const Eigen::Matrix3d& f, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Algebraic at = AlgebraicError(f, a, b);
  return std::abs(at.error) / (at.slope_a + at.slope_b);
}

double SampsonDistance(const Eigen::Matrix3d& f, const Eigen::Vector2d& a, double sigma_a,
                       const Eigen::Vector2d& b, double sigma_b) {
  const Algebraic at = AlgebraicError(f, a, b);
  return at.error / std::hypot(sigma_a * at.slope_a, sigma_b * at.slope_b);
}

void LineDistanceSum::Add(const Eigen::Matrix3d& f, const Correspondence& corner) {
  const EpipolarDistance distance = DistanceBetween(f, corner.a, corner.b);
  distances_.push_back(distance.in_a);
  distances_.push_back(distance.in_b);
  worst_mask_ = std::max({worst_mask_, std::abs(distance.in_a) * a_.mask_scale(),
                          std::abs(distance.in_b) * b_.mask_scale()});
  // A corner's error in one image moves its line in the other.
  const double steep_a = (f.transpose() * corner.b.homogeneous()).head<2>().squaredNorm();
  const double steep_b = (f * corner.a.homogeneous()).head<2>().squaredNorm();
  const double variance_a = corner.sigma_a * corner.sigma_a;
  const double variance_b = corner.sigma_b * corner.sigma_b;
  noise_squares_ += variance_a + variance_b * steep_b / steep_a;
  noise_squares_ += variance_b + variance_a * steep_a / steep_b;
  const Eigen::Matrix3d of_masks = ScaledTo(f, a_.image, a_.mask, b_.image, b_.mask);
  margin_ = std::max(margin_, NeededMargin(of_masks, ScaledTo(corner.a, a_.image, a_.mask),
                                           ScaledTo(corner.b, b_.image, b_.mask)));
}

LineDistances LineDistanceSum::Result() const {
  LineDistances result{.corners = static_cast<int>(distances_.size() / 2), .margin = margin_};
  if (distances_.empty()) return result;
  std::vector<double> sorted = distances_;
  std::ranges::sort(sorted);
  double squares = 0;
  for (const double distance : sorted) squares += distance * distance;
  result.rms = std::sqrt(squares / static_cast<double>(sorted.size()));
  result.noise = std::sqrt(noise_squares_ / static_cast<double>(sorted.size()));
  result.median = sorted[sorted.size() / 2];
  result.worst = sorted.back();
  result.worst_mask = worst_mask_;
  return result;
}

namespace {

bool HasDistortion(const CameraModel& camera) {
  const auto& distortion = camera.intrinsics().distortion;
  return std::ranges::any_of(distortion, [](double k) { return k != 0; });
}

// The images in `b` of points along a pixel's ray.
std::vector<Eigen::Vector2d> Curve(const CameraModel& a, const Eigen::Vector2d& pixel,
                                   const CameraModel& b, double reach) {
  constexpr int kPoints = 60;
  std::vector<Eigen::Vector2d> curve;
  const std::optional<Eigen::Vector3d> ray = a.Ray(pixel);
  if (!ray) return curve;
  for (int i = 1; i <= kPoints; ++i) {
    // Even in the inverse of the depth, about as in the image.
    const double depth = reach * i / (kPoints * (1.0 + 9.0 * (kPoints - i) / kPoints));
    const auto there = b.Project(a.Centre() + depth * *ray);
    if (there && b.Contains(*there)) curve.push_back(*there);
  }
  return curve;
}

double DistanceFromChord(const std::vector<Eigen::Vector2d>& curve) {
  const Eigen::Vector2d chord = curve.back() - curve.front();
  const double length = chord.norm();
  if (!(length > 1)) return 0;
  double greatest = 0;
  for (const Eigen::Vector2d& point : curve) {
    const Eigen::Vector2d from = point - curve.front();
    greatest = std::max(greatest, std::abs(chord.x() * from.y() - chord.y() * from.x()) / length);
  }
  return greatest;
}

// Adds what pixels of `a` say.
void AddBow(const CameraModel& a, const CameraModel& b, const ViewSizes& size_a,
            const ViewSizes& size_b, double reach, LensBow& bow) {
  constexpr int kSteps = 12;
  const Eigen::Matrix3d f = FundamentalBetween(a, b);
  const Eigen::Matrix3d of_masks =
      ScaledTo(f, size_a.image, size_a.mask, size_b.image, size_b.mask);
  for (const Eigen::Vector2d& pixel : PointsAllOver(size_a.image, kSteps)) {
    const std::vector<Eigen::Vector2d> curve = Curve(a, pixel, b, reach);
    if (curve.empty()) continue;
    bow.curve = std::max(bow.curve, DistanceFromChord(curve));
    for (const Eigen::Vector2d& point : curve) {
      bow.off_lines = std::max(bow.off_lines, DistanceBetween(f, pixel, point).in_b);
      bow.margin =
          std::max(bow.margin, NeededMargin(of_masks, ScaledTo(pixel, size_a.image, size_a.mask),
                                            ScaledTo(point, size_b.image, size_b.mask)));
    }
  }
}

}  // namespace

LensBow BowBetween(const CameraModel& a, const CameraModel& b, const ViewSizes& size_a,
                   const ViewSizes& size_b, double reach) {
  LensBow bow;
  if (!HasDistortion(a) && !HasDistortion(b)) return bow;
  AddBow(a, b, size_a, size_b, reach, bow);
  AddBow(b, a, size_b, size_a, reach, bow);
  return bow;
}

std::optional<Correspondence> Undistorted(const CameraModel& a, const CameraModel& b,
                                          const Correspondence& corner) {
  const auto at_a = a.Undistorted(corner.a);
  const auto at_b = b.Undistorted(corner.b);
  if (!at_a || !at_b) return std::nullopt;
  Correspondence undistorted = corner;
  undistorted.a = *at_a;
  undistorted.b = *at_b;
  return undistorted;
}

}  // namespace silhouette
