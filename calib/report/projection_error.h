// How uncertain a camera's image of a point is through its pose.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/poses/pose_solution.h"

namespace silhouette {

// Derivatives of a pixel: by a small motion (rotation vector, translation) of the frame on a pose's
// right-hand side, as PoseCovariance has it. The point is lens(before * pose * after * point), and
// `lens` has the identity as pose. Nothing if the point is not before the camera.
std::optional<Eigen::Matrix<double, 2, 6>> PixelByMotion(const CameraModel& lens,
                                                         const Eigen::Isometry3d& before,
                                                         const Eigen::Isometry3d& pose,
                                                         const Eigen::Vector3d& point);

// Variance per axis of a world point's pixel.
std::optional<double> PixelVariance(const CameraModel& lens, const SolvedView& view,
                                    const Eigen::Vector3d& point);

// The points that lie in the image of the camera at its solved pose.
std::vector<Eigen::Vector3d> PointsInImage(const CameraModel& lens, const SolvedView& view,
                                           std::span<const Eigen::Vector3d> points);

}  // namespace silhouette
