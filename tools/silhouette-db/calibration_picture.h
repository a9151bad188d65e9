// SPDX-License-Identifier: Apache-2.0
// The epipolar bands of some pixels, over the robot.
#pragma once

#include <vector>

#include "common/picture/picture.h"
#include "tools/silhouette-db/calibration_files/tested_calibration.h"

namespace silhouette {

struct MaskPixel {
  int x = 0;
  int y = 0;
};

// The most pixels in one picture: each has a colour of its own.
inline constexpr size_t kMostPixels = 4;

// Pixels of the robot in `view`, spread over its image, those that contradict another view first;
// none if the robot is not in the image.
std::vector<MaskPixel> PixelsToShow(const std::vector<Mask>& robot, const EpipolarBands& bands,
                                    int view);

// What a picture of bands shows.
struct BandsPicture {
  const Database& database;
  const EpipolarBands& bands;
  ConfigurationNumber number = 0;  // of the robot images
  const std::vector<Mask>& robot;
  std::vector<Mask> union_of_all;  // where the robot was seen at all; one per view
  int view = 0;
  std::vector<MaskPixel> pixels;  // of `view`, at most kMostPixels
};

Picture Paint(const BandsPicture& picture);

}  // namespace silhouette
