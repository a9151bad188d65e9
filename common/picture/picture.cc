// SPDX-License-Identifier: Apache-2.0
#include "common/picture/picture.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "common/picture/files.h"

namespace silhouette {
namespace {

cv::Vec3b PictureBgr(Colour colour) { return {colour.blue, colour.green, colour.red}; }

void Paint(Picture& picture, const Mask& mask, Colour colour) {
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      if (mask.at(x, y)) picture.at<cv::Vec3b>(y, x) = PictureBgr(colour);
    }
  }
}

}  // namespace

Picture BlankPicture(int width, int height, Colour colour) {
  return Picture(height, width, CV_8UC3, cv::Scalar(colour.blue, colour.green, colour.red));
}

Picture PictureOf(const Mask& mask, Colour set, Colour not_set) {
  Picture picture = BlankPicture(mask.width(), mask.height(), not_set);
  Paint(picture, mask, set);
  return picture;
}

Picture PictureOfPlanes(const Mask& obstacle, const Mask& unknown, const Mask& error) {
  if (obstacle.size() != unknown.size() || obstacle.size() != error.size()) {
    throw std::invalid_argument("planes of different sizes");
  }
  Picture picture = PictureOf(obstacle, palette::kObstacle);
  Paint(picture, unknown, palette::kUnknown);
  Paint(picture, error, palette::kError);
  return picture;
}

Picture PictureOfPixels(int width, int height, int channels, std::span<const uint8_t> pixels) {
  if ((channels != 1 && channels != 3) || width < 1 || height < 1 ||
      pixels.size() != size_t{1} * width * height * channels) {
    throw std::invalid_argument("these are not the pixels of an image of this size");
  }
  const cv::Mat input(height, width, channels == 1 ? CV_8UC1 : CV_8UC3,
                      const_cast<uint8_t*>(pixels.data()));
  Picture picture;
  if (channels == 1) {
    cv::cvtColor(input, picture, cv::COLOR_GRAY2BGR);
  } else {
    picture = input.clone();
  }
  return picture;
}

Picture Enlarged(const Picture& picture, int factor) {
  Picture enlarged;
  cv::resize(picture, enlarged, {}, factor, factor, cv::INTER_NEAREST);
  return enlarged;
}

Picture FittedInto(const Picture& picture, int width, int height, Colour around) {
  const double scale = std::min(static_cast<double>(width) / picture.cols,
                                static_cast<double>(height) / picture.rows);
  const cv::Size size(std::max(1, static_cast<int>(picture.cols * scale + 0.5)),
                      std::max(1, static_cast<int>(picture.rows * scale + 0.5)));
  Picture scaled;
  cv::resize(picture, scaled, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_NEAREST);
  Picture fitted = BlankPicture(width, height, around);
  scaled.copyTo(fitted(
      cv::Rect((width - size.width) / 2, (height - size.height) / 2, size.width, size.height)));
  return fitted;
}

Picture WithVeil(const Picture& picture, const Mask& mask, Colour colour, double opacity) {
  Picture veiled = picture.clone();
  for (int y = 0; y < veiled.rows; ++y) {
    for (int x = 0; x < veiled.cols; ++x) {
      if (!mask.at(x * mask.width() / veiled.cols, y * mask.height() / veiled.rows)) continue;
      cv::Vec3b& pixel = veiled.at<cv::Vec3b>(y, x);
      for (int c = 0; c < 3; ++c) {
        pixel[c] =
            cv::saturate_cast<uint8_t>(opacity * PictureBgr(colour)[c] + (1 - opacity) * pixel[c]);
      }
    }
  }
  return veiled;
}

std::string EncodePng(const Picture& picture) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", picture, bytes);
  return {bytes.begin(), bytes.end()};
}

absl::Status WritePng(const std::string& path, const Picture& picture) {
  return WriteWholeFile(path, EncodePng(picture));
}

}  // namespace silhouette
