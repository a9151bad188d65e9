// TagSighting: one tag seen in one image. What all of calibration starts from.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

namespace silhouette {

struct TagSighting {
  std::string frame;   // images with the same frame were taken at once, of a cell that stood still
  std::string view;    // the camera
  std::string family;  // of the tag, e.g. tagStandard41h12
  int tag = 0;         // its id
  // Pixels of the camera's image, integers at pixel centres; in the order of Board::CornersOf.
  std::array<Eigen::Vector2d, 4> corners{};
  double sigma = 0;  // standard deviation of a corner per axis, pixels
};

}  // namespace silhouette
