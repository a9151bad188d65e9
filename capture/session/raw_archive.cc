// SPDX-License-Identifier: Apache-2.0
#include "capture/session/raw_archive.h"

#include <opencv2/imgcodecs.hpp>

#include "capture/session/reference_images.h"

namespace silhouette {
namespace {

std::string Png(const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 2});
  return {bytes.begin(), bytes.end()};
}

// An image as the camera takes it of the empty cell.
cv::Mat Likely(const Reference& reference) {
  cv::RNG random(1);
  cv::Mat noise(reference.size(), CV_32FC(reference.channels()));
  random.fill(noise, cv::RNG::NORMAL, 0, 1);
  cv::Mat mean;
  cv::Mat sigma;
  reference.mean().convertTo(mean, CV_32F, 1.0 / Reference::kGreyLevel);
  reference.noise().convertTo(sigma, CV_32F, 1.0 / Reference::kGreyLevel);
  cv::min(sigma, 20.0, sigma);  // of pixels of which nothing is known it is without bounds
  cv::Mat image;
  cv::Mat(mean + noise.mul(sigma)).convertTo(image, CV_8U);
  return image;
}

}  // namespace

std::vector<std::string> RawImagesOf(const ImageSet& images) {
  std::vector<std::string> raw;
  for (const cv::Mat& image : images.images) raw.push_back(Png(image));
  return raw;
}

cv::Mat ImageInPng(const std::string& png) {
  if (png.empty()) return {};
  const cv::Mat bytes(1, static_cast<int>(png.size()), CV_8UC1, const_cast<char*>(png.data()));
  return cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
}

uint64_t EstimateRawBytes(const storage::v1::CellDescription& cell, const Database* database) {
  uint64_t bytes = 0;
  if (database != nullptr) {
    const auto references = ReadReferences(*database);
    if (references.ok()) {
      for (const Reference& reference : *references) bytes += Png(Likely(reference)).size() + 64;
      return bytes;
    }
  }
  for (const storage::v1::View& view : cell.views()) {
    bytes += static_cast<uint64_t>(view.image_width()) * static_cast<uint64_t>(view.image_height());
  }
  return bytes;
}

}  // namespace silhouette
