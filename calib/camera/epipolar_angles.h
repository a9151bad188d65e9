// SPDX-License-Identifier: Apache-2.0
// What two views can say about each other: which pixels of the one may show the same point as a
// pixel of the other (paper §3.3).
//
// All points that a pixel may show lie between two planes through both cameras' centres. The angle
// of such a plane about the line between the centres, the epipolar-plane angle, is the same in both
// images: two pixels may show the same point if, and only if, the intervals of the angles within
// their squares overlap. That holds whatever the distortion, and gives the band of all epipolar
// lines of a pixel's square rather than the line of its centre.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/camera/pixel_size.h"

namespace silhouette {

// The angles within one pixel's square: from `from` to `to`, from <= to <= from + period; the whole
// period if the epipole lies in the square or the camera sees nothing there.
struct AngleInterval {
  double from = 0;
  double to = 0;
};

struct EpipolarAngles {
  // After which angles come again: 2 pi between camera models, where the half-planes on either side
  // of the cameras' axis differ; pi between images of which only a fundamental matrix is known.
  double period = 0;
  // Per pixel, row by row from the top left.
  std::vector<AngleInterval> a;
  std::vector<AngleInterval> b;
};

// From two camera models, whose intrinsics are those of the masks (CameraModel::ScaledTo).
// `margin`: pixels by which every pixel's square is widened on all sides, for the error of the
// calibration. Throws std::invalid_argument if the cameras have the same centre or the margin is
// negative.
EpipolarAngles AnglesBetween(const CameraModel& a, const CameraModel& b, double margin = 0);

// From a fundamental matrix, x_b' F x_a = 0 in mask pixels, integers at pixel centres. Throws
// std::invalid_argument if F is not finite or not of rank 2, a size is not positive, or the margin
// is negative.
EpipolarAngles AnglesBetween(const Eigen::Matrix3d& f, PixelSize size_a, PixelSize size_b,
                             double margin = 0);

}  // namespace silhouette
