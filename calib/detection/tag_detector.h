// SPDX-License-Identifier: Apache-2.0
// TagDetector: the AprilTags in an image, with corners to some hundredths of a pixel.
//
// The AprilTag library finds the tags, OpenCV those of ArUco dictionaries. Where a tag is large
// enough, steps are fitted to the grey values beside its four edges, in undistorted coordinates if
// the lens is known, else with curved edges; its corners are where they meet. Smaller AprilTags
// keep the library's corners, smaller ArUco markers are left out.
#pragma once

#include <array>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/detection/corner_fit.h"

namespace silhouette {

// A tag, or a mark of another board.
struct DetectedTag {
  std::string family;
  int tag = 0;
  std::vector<Eigen::Vector2d> corners;  // integers at pixel centres; as Board::CornersOf
  double sigma = 0;                      // standard deviation of a corner per axis, pixels
  double size = 0;                       // mean length of a tag's, or a square's, sides, pixels
  bool fitted = false;                   // corners by fitted edges or centroids, else the library's
  double blur = 0;                       // of its edges, pixels; 0 if none are fitted
};

class TagDetector {
 public:
  // Throws std::invalid_argument for an unknown family, or none.
  explicit TagDetector(const std::vector<std::string>& families);
  ~TagDetector();
  TagDetector(TagDetector&&) noexcept;
  TagDetector& operator=(TagDetector&&) noexcept;

  // `image`: CV_8UC1. In the order of families and ids. Not thread-safe. Throws
  // std::invalid_argument for another type of image.
  std::vector<DetectedTag> Detect(const cv::Mat& image,
                                  const std::optional<CameraModel>& lens = std::nullopt);

 private:
  struct Library;
  std::unique_ptr<Library> library_;
};

}  // namespace silhouette
