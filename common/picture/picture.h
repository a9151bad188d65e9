// SPDX-License-Identifier: Apache-2.0
// Pictures for people: masks and planes in the colours of palette.h, as PNG files.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "common/picture/palette.h"
#include "db/mask/mask.h"

namespace silhouette {

// 8 bits each of blue, green and red per pixel (CV_8UC3). Copies share their pixels.
using Picture = cv::Mat;

// As OpenCV draws it.
inline cv::Scalar BgrOf(Colour colour) {
  return {double(colour.blue), double(colour.green), double(colour.red)};
}

// A picture of one colour.
Picture BlankPicture(int width, int height, Colour colour = palette::kPaper);

// One byte per mask pixel: 255 set, 0 not (CV_8UC1).
cv::Mat MaskImage(const Mask& mask);

// One pixel per mask pixel.
Picture PictureOf(const Mask& mask, Colour set = palette::kInk,
                  Colour not_set = palette::kBackground);

// The planes of an obstacle, intersection or collision image; all of one size. What is in none of
// them is background.
Picture PictureOfPlanes(const Mask& obstacle, const Mask& unknown, const Mask& error);

// A camera image: `channels` bytes per pixel (1: grey; 3: blue, green, red), row by row.
// Throws std::invalid_argument if there are not width * height * channels of them.
Picture PictureOfPixels(int width, int height, int channels, std::span<const uint8_t> pixels);

// Every pixel as a square of factor x factor.
Picture Enlarged(const Picture& picture, int factor);

// The whole of `picture`, as large as fits into width x height, in the middle of it.
Picture FittedInto(const Picture& picture, int width, int height,
                   Colour around = palette::kBackground);

// `picture` with the mask laid over it as a veil of `colour`; `opacity` 0 to 1. The mask is
// stretched to the picture's size.
Picture WithVeil(const Picture& picture, const Mask& mask, Colour colour, double opacity);

// The bytes of a PNG file.
std::string EncodePng(const Picture& picture);

// Writes a PNG file; the errors name it.
absl::Status WritePng(const std::string& path, const Picture& picture);

}  // namespace silhouette
