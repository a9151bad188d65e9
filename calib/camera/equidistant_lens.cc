// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/equidistant_lens.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace silhouette {
namespace {

constexpr double kWidest = 85 * std::numbers::pi / 180;
constexpr int kSamples = 400;
constexpr int kRounds = 20;

double DistanceAt(double angle, const std::array<double, 4>& k) {
  const double a2 = angle * angle;
  return angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
}

// From the principal point to the farthest corner, in focal lengths.
double FarthestCorner(const CameraIntrinsics& in) {
  const double x = std::max(in.cx + 0.5, in.width - 0.5 - in.cx) / in.fx;
  const double y = std::max(in.cy + 0.5, in.height - 0.5 - in.cy) / in.fy;
  return std::hypot(x, y);
}

// The angle at which the farthest corner sees.
double WidestAngle(const CameraIntrinsics& in, const std::array<double, 4>& k) {
  const double corner = FarthestCorner(in);
  constexpr int kAngles = 10000;
  double before = 0;
  for (int step = 1; step <= kAngles; ++step) {
    const double angle = kWidest * step / kAngles;
    const double distance = DistanceAt(angle, k);
    if (!(distance > before)) {
      throw std::invalid_argument(
          "the equidistant lens folds back within the image: its coefficients are of another "
          "order, or of another camera");
    }
    if (distance >= corner) return angle;
    before = distance;
  }
  throw std::invalid_argument(
      "the image shows what is 85 degrees and more from the camera's axis, which no lens of OpenCV "
      "with a plane image can hold; crop the images");
}

}  // namespace

// The rational N(r^2) / D(r^2) that is nearest to distance / r, r = tan(angle), by linear least
// squares whose equations are divided by the D of the round before (Sanathanan and Koerner, 1963).
EquidistantFit NearestToEquidistant(const CameraIntrinsics& pinhole,
                                    const std::array<double, 4>& k) {
  const double widest = WidestAngle(pinhole, k);
  const double scale = std::tan(widest);
  Eigen::ArrayXd s(kSamples);  // (r / scale)^2
  Eigen::ArrayXd distance(kSamples);
  Eigen::ArrayXd ratio(kSamples);
  for (int i = 0; i < kSamples; ++i) {
    const double angle = widest * (i + 1) / kSamples;
    const double r = std::tan(angle);
    s[i] = r * r / (scale * scale);
    distance[i] = DistanceAt(angle, k);
    ratio[i] = distance[i] / r;
  }
  Eigen::MatrixXd powers(kSamples, 3);
  powers << s, s * s, s * s * s;
  Eigen::ArrayXd divisor = Eigen::ArrayXd::Ones(kSamples);
  Eigen::VectorXd terms;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::ArrayXd weight = distance / ratio / divisor;
    Eigen::MatrixXd equations(kSamples, 6);
    equations << powers.array().colwise() * weight, powers.array().colwise() * (-ratio * weight);
    terms = equations.colPivHouseholderQr().solve(((ratio - 1) * weight).matrix());
    divisor = 1 + (powers * terms.tail<3>()).array();
  }
  EquidistantFit fit{.intrinsics = pinhole};
  const double s2 = 1 / (scale * scale);
  fit.intrinsics.distortion = {
      terms[0] * s2,      terms[1] * s2 * s2,     0, 0, terms[2] * s2 * s2 * s2, terms[3] * s2,
      terms[4] * s2 * s2, terms[5] * s2 * s2 * s2};
  for (int i = 0; i < kSamples; ++i) {
    const double shown = Distort(fit.intrinsics, scale * std::sqrt(s[i]), 0.0).x();
    fit.worst =
        std::max(fit.worst, std::abs(shown - distance[i]) * std::max(pinhole.fx, pinhole.fy));
  }
  if (!(CameraModel(fit.intrinsics).FoldRadius() > scale)) {
    throw std::invalid_argument(
        "the equidistant lens is too far from any of OpenCV's rational ones; crop the images");
  }
  return fit;
}

}  // namespace silhouette
