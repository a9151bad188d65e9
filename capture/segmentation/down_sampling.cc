// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/down_sampling.h"

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

namespace silhouette {
namespace {

// The camera pixels, along one axis, that overlap a mask pixel. Lengths are in mask-size-ths of a
// camera pixel, so that all are whole numbers.
struct Span {
  int first = 0;
  int last = 0;
  int64_t first_length = 0;  // of `first`; all pixels between count whole
  int64_t last_length = 0;   // of `last`; 0 if it is `first`
};

std::vector<Span> Spans(int camera_pixels, int mask_pixels) {
  const int64_t from_camera = mask_pixels;
  std::vector<Span> spans;
  for (int i = 0; i < mask_pixels; ++i) {
    const int64_t begin = int64_t{i} * camera_pixels;
    const int64_t end = begin + camera_pixels;
    Span span;
    span.first = static_cast<int>(begin / from_camera);
    span.last = static_cast<int>((end - 1) / from_camera);
    span.first_length = std::min(end, (span.first + 1) * from_camera) - begin;
    if (span.last > span.first) span.last_length = end - span.last * from_camera;
    spans.push_back(span);
  }
  return spans;
}

// The foreground's length within a span of a row.
int64_t DownSamplingCovered(const uint8_t* row, const Span& span, int64_t whole) {
  int64_t covered = row[span.first] != 0 ? span.first_length : 0;
  for (int x = span.first + 1; x < span.last; ++x) covered += row[x] != 0 ? whole : 0;
  return covered + (row[span.last] != 0 ? span.last_length : 0);
}

// Sets the mask pixels whose spans hold any foreground at all.
std::vector<uint64_t> Touched(const cv::Mat& foreground, MaskSize size,
                              const std::vector<Span>& columns, const std::vector<Span>& rows) {
  std::vector<uint64_t> words(size.words());
  std::vector<uint8_t> any(static_cast<size_t>(foreground.cols));  // of the rows of a mask pixel
  size_t bit = 0;
  for (const Span& row : rows) {
    std::fill(any.begin(), any.end(), uint8_t{0});
    for (int y = row.first; y <= row.last; ++y) {
      const uint8_t* __restrict pixels = foreground.ptr<uint8_t>(y);
      uint8_t* __restrict into = any.data();
      for (int x = 0; x < foreground.cols; ++x) into[x] = static_cast<uint8_t>(into[x] | pixels[x]);
    }
    for (const Span& column : columns) {
      const auto begin = any.begin() + column.first;
      const bool set =
          std::any_of(begin, any.begin() + column.last + 1, [](uint8_t p) { return p; });
      words[bit / 64] |= uint64_t{set} << (bit % 64);
      ++bit;
    }
  }
  return words;
}

}  // namespace

Mask DownSample(const cv::Mat& foreground, MaskSize size, double min_cover) {
  if (foreground.empty() || foreground.type() != CV_8UC1) {
    throw std::invalid_argument("the foreground is an 8-bit image of one channel");
  }
  if (!size.valid()) throw std::invalid_argument("each side of a mask is 1 to 1024 pixels");
  if (!(min_cover >= 0 && min_cover < 1)) {
    throw std::invalid_argument("min_cover is a share of at least 0 and below 1");
  }
  const std::vector<Span> columns = Spans(foreground.cols, size.width);
  const std::vector<Span> rows = Spans(foreground.rows, size.height);
  if (min_cover == 0) return Mask::FromWords(size, Touched(foreground, size, columns, rows));
  const double least = min_cover * foreground.cols * foreground.rows;

  std::vector<uint64_t> words(size.words());
  std::vector<int64_t> areas(columns.size());  // foreground under the mask pixels of one row
  for (int y = 0; y < size.height; ++y) {
    const Span& span = rows[static_cast<size_t>(y)];
    std::fill(areas.begin(), areas.end(), 0);
    for (int row = span.first; row <= span.last; ++row) {
      const int64_t length = row == span.first  ? span.first_length
                             : row == span.last ? span.last_length
                                                : size.height;
      const auto* pixels = foreground.ptr<uint8_t>(row);
      for (size_t x = 0; x < columns.size(); ++x) {
        areas[x] += length * DownSamplingCovered(pixels, columns[x], size.width);
      }
    }
    for (size_t x = 0; x < columns.size(); ++x) {
      if (!(static_cast<double>(areas[x]) > least)) continue;
      const size_t bit = static_cast<size_t>(y) * columns.size() + x;
      words[bit / 64] |= uint64_t{1} << (bit % 64);
    }
  }
  return Mask::FromWords(size, std::move(words));
}

}  // namespace silhouette
