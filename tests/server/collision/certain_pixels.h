// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "server/collision/voxel_space.h"

namespace silhouette::testing {

// The certain pixels of a voxel, x and y of each; none outside the active blocks.
inline std::vector<std::pair<int, int>> CertainPixels(const VoxelSpace& space, int view, int x,
                                                      int y, int z) {
  std::vector<std::pair<int, int>> pixels;
  const std::optional<size_t> place = space.PlaceOf(x, y, z);
  if (!place) return pixels;
  const VoxelSpace::Look& look = space.look(view);
  const uint32_t row = look.certain[*place] / look.row_bits();
  const auto height = static_cast<uint32_t>(look.mask_size.height);
  const int centre_x = static_cast<int>(look.certain[*place] % look.row_bits());
  const int centre_y = static_cast<int>(row % height);
  for (const PixelRun& run : look.shapes[row / height]) {
    const int pixel_y = centre_y + run.dy;
    if (pixel_y < 0 || pixel_y >= look.mask_size.height) continue;
    for (int pixel_x = centre_x + run.first; pixel_x <= centre_x + run.last; ++pixel_x) {
      if (pixel_x >= 0 && pixel_x < look.mask_size.width) pixels.emplace_back(pixel_x, pixel_y);
    }
  }
  return pixels;
}

}  // namespace silhouette::testing
