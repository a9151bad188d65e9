// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/weak_calibration.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <unsupported/Eigen/NonLinearOptimization>
#include <unsupported/Eigen/NumericalDiff>

#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/matrix_fit.h"

namespace silhouette {
namespace {

using Eigen::Vector2d;

// Straightens what a lens bows, and bows it again.
class Lens {
 public:
  Lens(PixelSize image, double bend)
      : middle_(0.5 * (image.width - 1), 0.5 * (image.height - 1)),
        corner_(0.5 * std::hypot(image.width, image.height)),
        bend_(bend) {}

  Vector2d Straightened(const Vector2d& pixel) const {
    const Vector2d from = (pixel - middle_) / corner_;
    return middle_ + (pixel - middle_) / (1 + bend_ * from.squaredNorm());
  }

  std::optional<Vector2d> Bowed(const Vector2d& straight) const {
    const double radius = (straight - middle_).norm() / corner_;
    const double root = 1 - 4 * bend_ * radius * radius;
    if (root < 0) return std::nullopt;
    return middle_ + (straight - middle_) * 2 / (1 + std::sqrt(root));
  }

 private:
  Vector2d middle_;
  double corner_;
  double bend_;
};

struct LensEstimateDistances : CornerFunction {
  PixelSize image_a;
  PixelSize image_b;

  int inputs() const { return kMatrixFreedoms + 2; }

  int operator()(const Eigen::VectorXd& p, Eigen::VectorXd& distances) const {
    const Eigen::Matrix3d f = chart.At(p);
    const Lens a(image_a, p[kMatrixFreedoms]);
    const Lens b(image_b, p[kMatrixFreedoms + 1]);
    for (size_t i = 0; i < corners.size(); ++i) {
      const Correspondence& c = corners[i];
      distances[static_cast<Eigen::Index>(i)] =
          SampsonDistance(f, a.Straightened(c.a), c.sigma_a, b.Straightened(c.b), c.sigma_b);
    }
    return 0;
  }
};

// Adds what `f` is wrong by if the truth is `true_f` behind the lenses.
void AddMargin(const Eigen::Matrix3d& f, const Eigen::Matrix3d& true_f, const Lens& lens_a,
               const Lens& lens_b, const ViewSizes& a, const ViewSizes& b, LensEstimate& estimate) {
  constexpr int kSteps = 10;
  const Eigen::Matrix3d of_masks = ScaledTo(f, a.image, a.mask, b.image, b.mask);
  for (const Vector2d& pixel : PointsAllOver(a.image, kSteps)) {
    const Eigen::Vector3d line = true_f * lens_a.Straightened(pixel).homogeneous();
    for (const Vector2d& straight : PointsOnLine(line, b.image, kSteps)) {
      const std::optional<Vector2d> there = lens_b.Bowed(straight);
      if (!there || !Contains(b.image, *there)) continue;
      estimate.off_lines = std::max(estimate.off_lines, DistanceBetween(f, pixel, *there).in_b);
      estimate.margin =
          std::max(estimate.margin, NeededMargin(of_masks, ScaledTo(pixel, a.image, a.mask),
                                                 ScaledTo(*there, b.image, b.mask)));
    }
  }
}

}  // namespace

LensEstimate EstimateLenses(const Eigen::Matrix3d& f, std::span<const Correspondence> corners,
                            const ViewSizes& a, const ViewSizes& b) {
  const MatrixChart chart(f, NormalisingOf(corners, &Correspondence::a),
                          NormalisingOf(corners, &Correspondence::b));
  Eigen::NumericalDiff<LensEstimateDistances> distances(
      LensEstimateDistances{{chart, corners}, a.image, b.image});
  Eigen::VectorXd p = Eigen::VectorXd::Zero(kMatrixFreedoms + 2);
  Eigen::VectorXd left(distances.values());
  distances(p, left);
  const double without = left.squaredNorm();
  Eigen::LevenbergMarquardt<Eigen::NumericalDiff<LensEstimateDistances>> minimiser(distances);
  minimiser.parameters.maxfev = 600;
  minimiser.minimize(p);
  distances(p, left);

  LensEstimate estimate{.bend_a = p[kMatrixFreedoms], .bend_b = p[kMatrixFreedoms + 1]};
  const double per_corner = left.squaredNorm() / static_cast<double>(corners.size());
  estimate.gain = (without - left.squaredNorm()) / std::max(1.0, per_corner);
  AddMargin(f, chart.At(p), Lens(a.image, estimate.bend_a), Lens(b.image, estimate.bend_b), a, b,
            estimate);
  return estimate;
}

}  // namespace silhouette
