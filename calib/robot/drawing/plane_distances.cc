// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/plane_distances.h"

#include <algorithm>
#include <cmath>

namespace silhouette {

// Half pixels throughout: whole numbers, as centres and sides of squares are.
PlaneDistances::PlaneDistances(const Mask& plane) : distances_(plane.size().pixels()) {
  const auto width = static_cast<size_t>(plane.width());
  const auto height = static_cast<size_t>(plane.height());
  const MaskWords words = plane.words();
  const auto is_set = [&](size_t x, size_t y) {
    const size_t bit = y * width + x;
    return (words[bit / 64] >> (bit % 64) & 1) != 0;
  };
  const int32_t kFar = 2 * kMost;
  // Along the column: one to the pixel's side, two for each pixel between.
  std::vector<int32_t> vertical(width * height, kFar);
  const auto next = [kFar](int32_t before) { return before == 0 ? 1 : std::min(before + 2, kFar); };
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      if (is_set(x, y)) {
        vertical[y * width + x] = 0;
      } else if (y > 0) {
        vertical[y * width + x] = next(vertical[(y - 1) * width + x]);
      }
    }
  }
  for (size_t y = height - 1; y-- > 0;) {
    for (size_t x = 0; x < width; ++x) {
      int32_t& here = vertical[y * width + x];
      here = std::min(here, next(vertical[(y + 1) * width + x]));
    }
  }
  std::vector<int32_t> square(width);
  std::vector<int32_t> best(width);
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      const int32_t here = vertical[y * width + x];
      square[x] = here * here;
      best[x] = square[x];
    }
    int32_t most = *std::ranges::max_element(best);
    for (size_t by = 1; by < width; ++by) {
      const auto half = static_cast<int32_t>(2 * by - 1);
      const int32_t aside = half * half;
      if (aside >= most) break;
      for (size_t x = by; x < width; ++x) best[x] = std::min(best[x], square[x - by] + aside);
      for (size_t x = by; x < width; ++x) {
        best[x - by] = std::min(best[x - by], square[x] + aside);
      }
      if (by % 8 == 0) most = *std::ranges::max_element(best);
    }
    for (size_t x = 0; x < width; ++x) {
      distances_[y * width + x] =
          static_cast<uint16_t>(std::sqrt(static_cast<double>(best[x])) * (kUnits / 2.0));
    }
  }
}

}  // namespace silhouette
