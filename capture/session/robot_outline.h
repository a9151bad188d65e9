// SPDX-License-Identifier: Apache-2.0
// Whether a camera image shows the robot where its model has it, with no empty cell to compare
// with.
#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "db/mask/mask.h"

namespace silhouette {

// How much of the robot's outline the image has edges along.
struct RobotOutline {
  // Shares of the outline's pixels: where the model has it, and beside, in the mean. Edges are the
  // steepest fifth of an image. So of an outline that is nothing in the image a fifth is on edges,
  // as everywhere.
  double there = 0;
  double beside = 0;

  // Half the outline shows what a robot in front of a cell as grey as itself leaves of it. An
  // outline that merely lies on a cluttered part of the cell has as many edges beside.
  static constexpr double kLeastThere = 0.5;
  static constexpr double kLeastMore = 0.2;
  bool Seen() const { return there >= kLeastThere && there - beside >= kLeastMore; }
};

// `image`: 8-bit, grey or blue, green, red. `robot`: the robot as its model has it in this image,
// in pixels of any size. Nothing if too little of its outline is within the image.
std::optional<RobotOutline> FindOutline(const cv::Mat& image, const Mask& robot);

// The outline: pixels of the robot beside one that is not, away from the image's border; 8-bit,
// 255, of the size of `robot`.
cv::Mat OutlineOf(const Mask& robot);

}  // namespace silhouette
