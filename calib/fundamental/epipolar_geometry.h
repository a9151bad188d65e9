// SPDX-License-Identifier: Apache-2.0
// Fundamental matrices: x_b' F x_a = 0 for the images x_a, x_b of one point, homogeneous pixel
// coordinates, integers at pixel centres. Pure functions.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/camera/epipolar_angles.h"
#include "calib/fundamental/correspondences.h"

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

// Whether a pixel coordinate lies on an image of this size.
bool Contains(PixelSize image, const Eigen::Vector2d& pixel);
// A lattice of points over the whole image, with `steps` steps from rim to rim along each axis.
std::vector<Eigen::Vector2d> PointsAllOver(PixelSize image, int steps);
// Points of a line, homogeneous, with `steps` even steps from rim to rim along the axis of the
// image that the line follows; they may lie outside the image.
std::vector<Eigen::Vector2d> PointsOnLine(const Eigen::Vector3d& line, PixelSize image, int steps);

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

// Distances of corners from the lines of a matrix: they show how good it is.

// Sizes of a view's camera images, and of the masks that are made of them.
struct ViewSizes {
  PixelSize image;
  PixelSize mask;

  // Mask pixels of an image pixel, at most.
  double mask_scale() const {
    return std::max(static_cast<double>(mask.width) / image.width,
                    static_cast<double>(mask.height) / image.height);
  }
};

// Pixels of the camera images; the distances in either image taken together.
struct LineDistances {
  int corners = 0;
  double rms = 0;
  double median = 0;
  double worst = 0;
  double worst_mask = 0;  // the same in mask pixels, each of its own image
  // What rms would be if the matrix were exact: from what the corners are said to be wrong by.
  double noise = 0;
  // By how many mask pixels all squares must be widened so that the worst corner's pixels meet
  // (CalibrationSettings::margin in server/scene).
  double margin = 0;
};

// Gathers distances of corners, under one matrix or several.
class LineDistanceSum {
 public:
  LineDistanceSum(const ViewSizes& a, const ViewSizes& b) : a_(a), b_(b) {}

  // `f`: for pixels of the camera images, as are the corner's.
  void Add(const Eigen::Matrix3d& f, const Correspondence& corner);
  // All zero if nothing was added.
  LineDistances Result() const;

 private:
  ViewSizes a_;
  ViewSizes b_;
  std::vector<double> distances_;  // two per corner
  double noise_squares_ = 0;       // expected of them
  double worst_mask_ = 0;
  double margin_ = 0;
};

// Fundamental matrices of cameras whose models are known, and what lenses take from them.

// What two views' distortion does to their lines. Pixels of the camera images.
struct LensBow {
  // Greatest distance of an epipolar curve, within the image, from the chord between its ends.
  double curve = 0;
  // Greatest distance of points on the curves from the matrix's lines, and the margin in mask
  // pixels that would make up for it: what it costs to use the matrix with images as the cameras
  // take them.
  double off_lines = 0;
  double margin = 0;
};

// Over pixels all over a's image and the points up to `reach` (metres) before it that both see;
// both ways. All zero without distortion, or if the views see nothing in common.
LensBow BowBetween(const CameraModel& a, const CameraModel& b, const ViewSizes& size_a,
                   const ViewSizes& size_b, double reach);

// The corner with both points undistorted; nothing beyond the distortion's fold.
std::optional<Correspondence> Undistorted(const CameraModel& a, const CameraModel& b,
                                          const Correspondence& corner);

}  // namespace silhouette
