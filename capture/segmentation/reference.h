// SPDX-License-Identifier: Apache-2.0
// Reference: the empty cell in one view, as the mean and the noise of every pixel.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <string>

#include "absl/status/statusor.h"

namespace silhouette {

// `image` as 8-bit grey: itself if it is that already (the pixels are shared), else turned from
// 8-bit blue, green, red. Throws std::invalid_argument if it is empty or anything else.
cv::Mat Grey(const cv::Mat& image);

// Mean and noise are kept as 256ths of a grey level, on the disk as in memory: a reference that was
// stored and read again gives the same masks, bit by bit. It cannot be changed once made, and can
// be read by any number of threads.
class Reference {
 public:
  // One grey level, in the units of mean() and noise().
  static constexpr int kGreyLevel = 256;
  // The noise of a pixel of which nothing is known, in all its channels.
  static constexpr uint16_t kUndefined = 65535;
  // Pixels whose mean is at least this many grey levels may be saturated.
  static constexpr int kSaturated = 250;

  // From at least two images of the empty cell, of one size; all grey, or all blue, green, red. A
  // pixel's noise is that by which a further image differs from the mean: its standard deviation
  // over the images, drawn towards the typical one of the whole image as far as few images leave it
  // uncertain, and what few images leave in the mean; of a pixel that jumps now and then, at least
  // a quarter of its largest deviation. Throws std::invalid_argument.
  static Reference FromImages(std::span<const cv::Mat> images);

  // From images with the robot in them, at configurations well spread over the grid, for cells that
  // the robot cannot leave. `covered`, by image: 8-bit, not 0 where the robot may be; empty: not
  // known. Of every pixel only the images count in which it is not covered: their median and the
  // noise of those near it. A pixel is undefined if they are fewer than kFewestUncovered, or if not
  // at least three of five are near the median. A part of the robot that never moves cannot be
  // distinguished from the cell unless `covered` shows it. Throws std::invalid_argument as
  // FromImages does.
  static constexpr int kFewestUncovered = 5;
  static Reference FromImagesWithRobot(std::span<const cv::Mat> images,
                                       std::span<const cv::Mat> covered);

  // From what MeanPng() and NoisePng() gave. InvalidArgument if one is not a 16-bit PNG with grey
  // or colour, or they differ in size or channels.
  static absl::StatusOr<Reference> FromPng(const std::string& mean_png,
                                           const std::string& noise_png);

  cv::Size size() const { return mean_.size(); }
  // 1: grey; 3: blue, green, red.
  int channels() const { return mean_.channels(); }
  // 16-bit, of channels(): mean grey level and its standard deviation, times kGreyLevel. Not to be
  // written to.
  const cv::Mat& mean() const { return mean_; }
  const cv::Mat& noise() const { return noise_; }

  // Median of the noise of some thousand values, times kGreyLevel.
  int typical_noise() const { return typical_noise_; }

  // 255 where a pixel is undefined: 8-bit, one channel; empty if none is.
  const cv::Mat& undefined() const { return undefined_; }
  // How many pixels are undefined, how many are saturated in some channel, and how many are
  // unsteady: have some noise of more than four times the typical one.
  struct Figures {
    int undefined = 0;
    int saturated = 0;
    int unsteady = 0;
    double mean_noise = 0;  // grey levels, of all pixels that are defined
  };
  Figures Describe() const;

  // The same for a grey camera image; itself if it is grey.
  Reference AsGrey() const;

  // 16-bit PNG images of mean() and noise(): lossless.
  std::string MeanPng() const;
  std::string NoisePng() const;

 private:
  Reference(cv::Mat mean, cv::Mat noise);

  cv::Mat mean_;
  cv::Mat noise_;
  cv::Mat undefined_;
  int typical_noise_ = 0;
};

}  // namespace silhouette
