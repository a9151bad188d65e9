// SPDX-License-Identifier: Apache-2.0
// Random robot images and obstacle images for tests.
#pragma once

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "server/collision/collision_checker.h"
#include "tests/random.h"

namespace silhouette {

// Each pixel is set with this probability.
inline Mask RandomMask(MaskSize size, double density, std::mt19937_64& random) {
  std::bernoulli_distribution set(density);
  return Mask::FromPredicate(size, [&](int, int) { return set(random); });
}

// A box of random place and extent, as robots and obstacles are: compact.
inline Mask RandomBox(MaskSize size, std::mt19937_64& random) {
  const auto range = [&](int limit) {
    int a = std::uniform_int_distribution<int>(0, limit - 1)(random);
    int b = std::uniform_int_distribution<int>(0, limit - 1)(random);
    return std::pair(std::min(a, b), std::max(a, b));
  };
  const auto columns = range(size.width);
  const auto rows = range(size.height);
  return Mask::FromPredicate(size, [=](int x, int y) {
    return columns.first <= x && x <= columns.second && rows.first <= y && y <= rows.second;
  });
}

inline std::vector<MaskSize> RandomSizes(int views, std::mt19937_64& random) {
  std::vector<MaskSize> sizes;
  for (int view = 0; view < views; ++view) {
    std::uniform_int_distribution<int> side(3, 12);
    sizes.push_back({side(random), side(random)});
  }
  return sizes;
}

// Sparse masks for every configuration of the grid.
inline RobotImageTable RandomTable(const ConfigurationGrid& grid,
                                   const std::vector<MaskSize>& sizes, double density,
                                   std::mt19937_64& random) {
  RobotImageTable::Builder builder(grid, sizes, grid.size());
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    std::vector<Mask> masks;
    for (MaskSize size : sizes) masks.push_back(RandomMask(size, density, random));
    builder.Add(number, masks);
  }
  return std::move(builder).Build();
}

inline ObstacleImages RandomObstacleImages(const std::vector<MaskSize>& sizes, double density,
                                           std::mt19937_64& random) {
  ObstacleImages images;
  for (MaskSize size : sizes) {
    images.push_back(ObstacleImage::FromScene(RandomMask(size, density, random),
                                              RandomMask(size, density, random)));
  }
  return images;
}

// Some configurations have no robot image, some are excluded, some corrupt, some images are empty.
inline RobotImageTable TableWithGaps(const ConfigurationGrid& grid,
                                     const std::vector<MaskSize>& sizes, std::mt19937_64& random) {
  RobotImageTable::Builder builder(grid, sizes, grid.size());
  std::vector<Mask> base;
  for (const MaskSize size : sizes) base.push_back(RandomBox(size, random));
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    const auto chance = random() % 100;
    if (chance == 0) continue;
    if (chance == 1) {
      builder.AddWithout(number, RobotImageState::kExcluded);
    } else if (chance == 2) {
      builder.AddWithout(number, RobotImageState::kCorrupt);
    } else {
      std::vector<Mask> masks;
      for (size_t view = 0; view < sizes.size(); ++view) {
        masks.push_back(RandomMask(sizes[view], chance % 5 == 0 ? 0 : 0.05, random));
        if (chance % 3 != 0)
          masks.back() = masks.back() | (base[view] & RandomBox(sizes[view], random));
      }
      builder.Add(number, masks);
    }
  }
  return std::move(builder).Build();
}

inline ObstacleImages RandomBoxScene(const std::vector<MaskSize>& sizes, bool may_lack_views,
                                     std::mt19937_64& random) {
  ObstacleImages images;
  for (const MaskSize size : sizes) {
    const Mask scene = RandomMask(size, 0.03, random) | RandomBox(size, random);
    images.push_back(ObstacleImage::FromScene(scene, RandomBox(size, random)));
    if (may_lack_views && random() % 8 == 0) images.back().reset();
  }
  return images;
}

}  // namespace silhouette
