// SPDX-License-Identifier: Apache-2.0
// ImageTags: what one image shows of the boards of a session, and what is to be said of the image.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/types.hpp>
#include <span>
#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/detection/board_detector.h"

namespace silhouette {

struct ImageTags {
  std::string frame;
  std::string view;
  cv::Size size;
  uint64_t digest = 0;  // of its pixels
  std::vector<DetectedTag> tags;
  int expected = 0;  // tags on those boards of which some are seen
  int at_rim = 0;    // tags with a corner so near to the image's rim that its edges may be cut off
  // Left out of `tags`.
  std::vector<DetectedTag> foreign;    // of no board
  std::vector<DetectedTag> ambiguous;  // seen at several places
  bool mirrored = false;               // it shows no tag, but would if it were turned over

  // Of `tags`; 0 if there are none.
  double MeanSize() const;      // of a side, pixels
  double MedianBlur() const;    // of the edges, pixels; 0 if none could be fitted
  double TypicalSigma() const;  // of a corner per axis, pixels: the root of the mean square
};

// `image`: CV_8UC1.
ImageTags FindTags(BoardDetector& detector, const cv::Mat& image,
                   const std::optional<CameraModel>& lens);

std::vector<TagSighting> SightingsOf(const ImageTags& image);

// Whether two images of a view show the same tags at the same places, to half a pixel: the second
// adds no information.
bool ShowTheSame(const ImageTags& a, const ImageTags& b);

// Where in a view's images corners have been seen.
class Coverage {
 public:
  static constexpr int kColumns = 8;
  static constexpr int kRows = 6;

  void Add(const ImageTags& image);

  cv::Size size() const { return size_; }
  const std::vector<Eigen::Vector2d>& corners() const { return corners_; }
  // How many corners lie in a cell of the image, which is divided into kColumns * kRows.
  int Count(int column, int row) const;
  // The share of cells with any.
  double Share() const;

 private:
  cv::Size size_;
  std::vector<Eigen::Vector2d> corners_;
};

}  // namespace silhouette
