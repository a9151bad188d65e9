// Reference: the empty cell in one view, as the mean and the noise of every pixel.
#pragma once

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

  // From at least two images of the empty cell, of one size, grey or blue, green, red. A pixel's
  // noise is its standard deviation over the images, drawn towards the typical one of the whole
  // image as far as few images leave it uncertain. Throws std::invalid_argument.
  static Reference FromImages(std::span<const cv::Mat> images);

  // From what MeanPng() and NoisePng() gave. InvalidArgument if one is not a 16-bit grey PNG, or
  // their sizes differ.
  static absl::StatusOr<Reference> FromPng(const std::string& mean_png,
                                           const std::string& noise_png);

  cv::Size size() const { return mean_.size(); }
  // 16-bit, one channel: mean grey level and its standard deviation, times kGreyLevel. Not to be
  // written to.
  const cv::Mat& mean() const { return mean_; }
  const cv::Mat& noise() const { return noise_; }

  // 16-bit grey PNG images of mean() and noise(): lossless.
  std::string MeanPng() const;
  std::string NoisePng() const;

 private:
  Reference(cv::Mat mean, cv::Mat noise);

  cv::Mat mean_;
  cv::Mat noise_;
};

}  // namespace silhouette
