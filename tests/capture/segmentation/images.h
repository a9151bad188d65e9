// SPDX-License-Identifier: Apache-2.0
// Images of an empty cell, and of things in it, for the tests of the segmentation.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

namespace silhouette {

// A room with texture: grey levels 40 to 160.
inline cv::Mat EmptyCell(cv::Size size) {
  cv::Mat image(size, CV_64FC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.at<double>(y, x) = 100 + 40 * std::sin(0.05 * x) * std::cos(0.07 * y) +
                               20.0 * ((x / 16 + y / 16) % 2 == 0 ? 1 : -1);
    }
  }
  return image;
}

// What a camera with noise makes of `light` when all is brighter by `gain`.
inline cv::Mat Expose(const cv::Mat& light, double gain, double sigma, std::mt19937_64& random) {
  std::normal_distribution<double> normal(0, 1);
  cv::Mat image(light.size(), CV_8UC1);
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x) {
      const double level = std::round(gain * light.at<double>(y, x) + sigma * normal(random));
      image.at<uint8_t>(y, x) = static_cast<uint8_t>(std::clamp(level, 0.0, 255.0));
    }
  }
  return image;
}

inline std::vector<cv::Mat> ExposeSeries(const cv::Mat& light, int count, double sigma,
                                         std::mt19937_64& random) {
  std::vector<cv::Mat> images;
  for (int i = 0; i < count; ++i) images.push_back(Expose(light, 1, sigma, random));
  return images;
}

inline bool SamePixels(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_L1) == 0;
}

}  // namespace silhouette
