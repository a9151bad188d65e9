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

// Bytes of the PNG file that `bytes` begins with; all of them if it does not end.
size_t LengthOfPng(std::string_view bytes) {
  constexpr size_t kSignature = 8;
  constexpr size_t kAroundData = 12;  // length and type before a chunk's data, checksum behind it
  size_t at = kSignature;
  while (bytes.size() >= kAroundData && at <= bytes.size() - kAroundData) {
    uint32_t data = 0;
    for (size_t i = 0; i < 4; ++i) data = data << 8 | static_cast<uint8_t>(bytes[at + i]);
    const bool last = bytes.substr(at + 4, 4) == "IEND";
    at += kAroundData + data;
    if (last && at <= bytes.size()) return at;
  }
  return bytes.size();
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

std::vector<std::string> RawImagesOf(const Visit& visit) {
  std::vector<std::string> raw;
  for (size_t v = 0; v < visit.images.images.size(); ++v) {
    raw.push_back(Png(visit.images.images[v]));
    for (const std::vector<cv::Mat>& set : visit.earlier) raw.back() += Png(set[v]);
  }
  return raw;
}

cv::Mat ImageInPng(const std::string& png) {
  if (png.empty()) return {};
  const cv::Mat bytes(1, static_cast<int>(png.size()), CV_8UC1, const_cast<char*>(png.data()));
  return cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
}

std::vector<cv::Mat> ImagesInPng(std::string_view png) {
  std::vector<cv::Mat> images;
  do {
    const size_t length = LengthOfPng(png);
    images.push_back(ImageInPng(std::string(png.substr(0, length))));
    png.remove_prefix(length);
  } while (!png.empty());
  return images;
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
