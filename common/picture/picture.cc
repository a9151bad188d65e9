// SPDX-License-Identifier: Apache-2.0
#include "common/picture/picture.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "common/picture/files.h"

namespace silhouette {

Picture BlankPicture(int width, int height, Colour colour) {
  return Picture(height, width, CV_8UC3, BgrOf(colour));
}

cv::Mat MaskImage(const Mask& mask) {
  cv::Mat image(mask.height(), mask.width(), CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image.at<uint8_t>(y, x) = mask.at(x, y) ? 255 : 0;
  }
  return image;
}

Picture PictureOf(const Mask& mask, Colour set, Colour not_set) {
  return BlankPicture(mask.width(), mask.height(), not_set).setTo(BgrOf(set), MaskImage(mask));
}

Picture PictureOfPlanes(const Mask& obstacle, const Mask& unknown, const Mask& error) {
  if (obstacle.size() != unknown.size() || obstacle.size() != error.size()) {
    throw std::invalid_argument("planes of different sizes");
  }
  Picture picture = PictureOf(obstacle, palette::kObstacle);
  picture.setTo(BgrOf(palette::kUnknown), MaskImage(unknown));
  picture.setTo(BgrOf(palette::kError), MaskImage(error));
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
  cv::Mat where;
  cv::resize(MaskImage(mask), where, picture.size(), 0, 0, cv::INTER_NEAREST);
  Picture tinted;
  cv::addWeighted(BlankPicture(picture.cols, picture.rows, colour), opacity, picture, 1 - opacity,
                  0, tinted);
  Picture veiled = picture.clone();
  tinted.copyTo(veiled, where);
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
