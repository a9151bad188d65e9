#include "calib/fundamental/line_distances.h"

#include <algorithm>
#include <cmath>

#include "calib/fundamental/epipolar_geometry.h"

namespace silhouette {

void LineDistanceSum::Add(const Eigen::Matrix3d& f, const Correspondence& corner) {
  const EpipolarDistance distance = DistanceBetween(f, corner.a, corner.b);
  distances_.push_back(distance.in_a);
  distances_.push_back(distance.in_b);
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
  std::sort(sorted.begin(), sorted.end());
  double squares = 0;
  for (const double distance : sorted) squares += distance * distance;
  result.rms = std::sqrt(squares / static_cast<double>(sorted.size()));
  result.noise = std::sqrt(noise_squares_ / static_cast<double>(sorted.size()));
  result.median = sorted[sorted.size() / 2];
  result.worst = sorted.back();
  return result;
}

}  // namespace silhouette
