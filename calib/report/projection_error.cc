#include "calib/report/projection_error.h"

namespace silhouette {

std::optional<Eigen::Matrix<double, 2, 6>> PixelByMotion(const CameraModel& lens,
                                                         const Eigen::Isometry3d& before,
                                                         const Eigen::Isometry3d& pose,
                                                         const Eigen::Vector3d& point) {
  constexpr double kStep = 1e-6;  // metres
  const Eigen::Vector3d in_camera = before * pose * point;
  Eigen::Matrix<double, 2, 3> by_point;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
    const auto more = lens.Project(in_camera + step);
    const auto less = lens.Project(in_camera - step);
    if (!more || !less) return std::nullopt;
    by_point.col(axis) = (*more - *less) / (2 * kStep);
  }
  Eigen::Matrix<double, 3, 6> motion;
  motion << 0, point.z(), -point.y(), 1, 0, 0,  //
      -point.z(), 0, point.x(), 0, 1, 0,        //
      point.y(), -point.x(), 0, 0, 0, 1;
  return by_point * (before.linear() * pose.linear()) * motion;
}

std::optional<double> PixelVariance(const CameraModel& lens, const SolvedView& view,
                                    const Eigen::Vector3d& point) {
  const auto by_motion =
      PixelByMotion(lens, Eigen::Isometry3d::Identity(), view.camera_pose, point);
  if (!by_motion) return std::nullopt;
  return (*by_motion * view.covariance * by_motion->transpose()).trace() / 2;
}

std::vector<Eigen::Vector3d> PointsInImage(const CameraModel& lens, const SolvedView& view,
                                           std::span<const Eigen::Vector3d> points) {
  std::vector<Eigen::Vector3d> in_image;
  for (const Eigen::Vector3d& point : points) {
    const auto pixel = lens.Project(view.camera_pose * point);
    if (pixel && lens.Contains(*pixel)) in_image.push_back(point);
  }
  return in_image;
}

}  // namespace silhouette
