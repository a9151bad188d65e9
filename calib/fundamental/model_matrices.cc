#include "calib/fundamental/model_matrices.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/fundamental/epipolar_geometry.h"

namespace silhouette {
namespace {

bool HasDistortion(const CameraModel& camera) {
  const auto& distortion = camera.intrinsics().distortion;
  return std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0; });
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
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d pixel(-0.5 + static_cast<double>(i) * size_a.image.width / kSteps,
                                  -0.5 + static_cast<double>(j) * size_a.image.height / kSteps);
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

std::optional<Eigen::Vector2d> Undistorted(const CameraModel& camera,
                                           const Eigen::Vector2d& pixel) {
  const std::optional<Eigen::Vector3d> ray = camera.Ray(pixel);
  if (!ray) return std::nullopt;
  const Eigen::Vector3d in_camera = camera.camera_from_world().linear() * *ray;
  if (!(in_camera.z() > 0)) return std::nullopt;
  const CameraIntrinsics& k = camera.intrinsics();
  return Eigen::Vector2d(k.fx * in_camera.x() / in_camera.z() + k.cx,
                         k.fy * in_camera.y() / in_camera.z() + k.cy);
}

std::optional<Correspondence> Undistorted(const CameraModel& a, const CameraModel& b,
                                          const Correspondence& corner) {
  const auto at_a = Undistorted(a, corner.a);
  const auto at_b = Undistorted(b, corner.b);
  if (!at_a || !at_b) return std::nullopt;
  Correspondence undistorted = corner;
  undistorted.a = *at_a;
  undistorted.b = *at_b;
  return undistorted;
}

}  // namespace silhouette
