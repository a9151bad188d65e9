// How far corners are from the lines of a matrix: what tells whether it is any good.
#pragma once

#include <vector>

#include "calib/camera/epipolar_angles.h"
#include "calib/fundamental/correspondences.h"

namespace silhouette {

// Sizes of a view's camera images, and of the masks that are made of them.
struct ViewSizes {
  PixelSize image;
  PixelSize mask;
};

// Pixels of the camera images; the distances in either image taken together.
struct LineDistances {
  int corners = 0;
  double rms = 0;
  double median = 0;
  double worst = 0;
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
  double margin_ = 0;
};

}  // namespace silhouette
