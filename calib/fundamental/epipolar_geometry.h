// Fundamental matrices: x_b' F x_a = 0 for the images x_a, x_b of one point, homogeneous pixel
// coordinates, integers at pixel centres. Pure functions.
#pragma once

#include <Eigen/Core>

#include "calib/camera/camera_model.h"
#include "calib/camera/epipolar_angles.h"

namespace silhouette {

// F of two cameras, in the pixels of their images as if these were undistorted: a camera's
// intrinsics without its distortion. Of Frobenius norm 1. Throws std::invalid_argument if the
// cameras stand at the same place.
Eigen::Matrix3d FundamentalBetween(const CameraModel& a, const CameraModel& b);

// The same matrix for images of other sizes that show the same fields, such as masks. Coordinates
// scale per axis about the images' corners, which lie half a pixel off the first pixel's centre:
// x' = (x + 0.5) * to / from - 0.5. Linear in f.
Eigen::Matrix3d ScaledTo(const Eigen::Matrix3d& f, PixelSize from_a, PixelSize to_a,
                         PixelSize from_b, PixelSize to_b);

// A pixel coordinate of an image of size `from` in one of size `to` that shows the same field.
Eigen::Vector2d ScaledTo(const Eigen::Vector2d& point, PixelSize from, PixelSize to);

// How far two points are from being images of one, by a matrix; pixels, not negative.
struct EpipolarDistance {
  double in_a = 0;  // of the point in a from the other's line
  double in_b = 0;
};
EpipolarDistance DistanceBetween(const Eigen::Matrix3d& f, const Eigen::Vector2d& a,
                                 const Eigen::Vector2d& b);

// By how many pixels the squares of all pixels, in both images, must be widened on all sides so
// that two pixels that show these points are sure to meet (AnglesBetween in
// calib/camera/epipolar_angles.h).
double NeededMargin(const Eigen::Matrix3d& f, const Eigen::Vector2d& a, const Eigen::Vector2d& b);

// Sampson's distance, signed, in units of the points' standard deviations (pixels per axis): of
// expectation 0 and deviation 1 for two points that have these errors.
double SampsonDistance(const Eigen::Matrix3d& f, const Eigen::Vector2d& a, double sigma_a,
                       const Eigen::Vector2d& b, double sigma_b);

}  // namespace silhouette
