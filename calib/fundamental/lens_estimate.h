// How much the lenses of two views bow lines, from nothing but tags that both saw. It shows whether
// a fundamental matrix can be true; for camera models it is too coarse.
#pragma once

#include <span>

#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/line_distances.h"

namespace silhouette {

// Radial, about the middle of the image, one number a view: an undistorted radius is
// r / (1 + bend * r^2), r = 1 in the image's corners (Fitzgibbon 2001).
struct LensEstimate {
  double bend_a = 0;
  double bend_b = 0;
  // By how much the lenses explain the corners better than a matrix alone: the fall of the sum of
  // squared deviations, in units of what is left per corner. Chance gives about 2.
  double gain = 0;
  // Margin in mask pixels that a matrix needs for such lenses, anywhere in the images, and the
  // distance from its lines, in pixels of the camera images.
  double margin = 0;
  double off_lines = 0;
};

// `f`: a matrix, for pixels of the camera images, that fits the corners about.
LensEstimate EstimateLenses(const Eigen::Matrix3d& f, std::span<const Correspondence> corners,
                            const ViewSizes& a, const ViewSizes& b);

}  // namespace silhouette
