#include "calib/report/repeatability.h"

#include <cmath>
#include <numbers>

#include "calib/report/pixel_sum.h"
#include "calib/report/projection_error.h"

namespace silhouette {
namespace {

// The standard error of the mean of what was found without a group each, a column each: of the
// length.
double StandardError(const Eigen::MatrixXd& found) {
  const Eigen::MatrixXd off = found.colwise() - found.rowwise().mean();
  const double groups = static_cast<double>(found.cols());
  return std::sqrt((groups - 1) / groups * off.squaredNorm());
}

}  // namespace

Repeatability JackknifeOf(const PoseProblem& problem, size_t view,
                          const std::vector<Eigen::Vector3d>& points,
                          const std::vector<PoseSolution>& parts) {
  const CameraModel lens(problem.views[view].lens, Eigen::Isometry3d::Identity());
  const auto groups = static_cast<Eigen::Index>(parts.size());
  Eigen::Matrix3Xd centres(3, groups);
  Eigen::Matrix3Xd turns(3, groups);
  const Eigen::Matrix3d first = parts.front().views[view].camera_pose.linear();
  for (Eigen::Index i = 0; i < groups; ++i) {
    const Eigen::Isometry3d& pose = parts[static_cast<size_t>(i)].views[view].camera_pose;
    centres.col(i) = pose.inverse().translation();
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(first.transpose() * pose.linear()));
    turns.col(i) = turn.angle() * turn.axis();
  }
  PixelSum sum;
  for (const Eigen::Vector3d& point : points) {
    Eigen::Matrix2Xd pixels(2, groups);
    bool seen = true;
    for (Eigen::Index i = 0; i < groups && seen; ++i) {
      const auto pixel =
          lens.Project(parts[static_cast<size_t>(i)].views[view].camera_pose * point);
      seen = pixel.has_value();
      if (seen) pixels.col(i) = *pixel;
    }
    if (!seen) continue;
    const double error = StandardError(pixels);
    sum.Add(error * error / 2);
  }
  return {.px = sum.Rms(),
          .mm = 1000 * StandardError(centres),
          .deg = StandardError(turns) * 180 / std::numbers::pi};
}

HalvesDifference DifferenceOf(const PoseProblem& problem, size_t view,
                              const std::vector<Eigen::Vector3d>& points, const PoseSolution& a,
                              const PoseSolution& b) {
  const CameraModel lens(problem.views[view].lens, Eigen::Isometry3d::Identity());
  PixelSum difference;
  PixelSum expected;
  for (const Eigen::Vector3d& point : points) {
    const auto by_a = lens.Project(a.views[view].camera_pose * point);
    const auto by_b = lens.Project(b.views[view].camera_pose * point);
    const auto variance_a = PixelVariance(lens, a.views[view], point);
    const auto variance_b = PixelVariance(lens, b.views[view], point);
    if (!by_a || !by_b || !variance_a || !variance_b) continue;
    difference.Add(Eigen::Vector2d(*by_a - *by_b));
    expected.Add(*variance_a + *variance_b);
  }
  return {.px = difference.Rms(), .expected_px = expected.Rms()};
}

}  // namespace silhouette
