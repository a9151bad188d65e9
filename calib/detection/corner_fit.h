// The corners of a tag as the places where its fitted edges meet.
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/detection/lens.h"

namespace silhouette {

using PixelCorners = std::array<Eigen::Vector2d, 4>;

struct FittedCorners {
  PixelCorners corners{};
  double sigma = 0;  // standard deviation per axis, pixels
  double blur = 0;   // mean of the edges', pixels
  double contrast = 0;
};

// `corners`: roughly, pixels with integers at pixel centres, of one tag and in an order that goes
// around it. `module`: the side of its modules, pixels. With an unknown lens edges may be curved.
// Nothing if an edge is not there as it should be, or a corner is not near where it was.
std::optional<FittedCorners> FitCorners(const cv::Mat& image, const Lens& lens,
                                        const PixelCorners& corners, double module);

}  // namespace silhouette
