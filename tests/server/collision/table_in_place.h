// SPDX-License-Identifier: Apache-2.0
// A table of robot images that are read when they are needed, for tests.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "server/collision/robot_image_table.h"
#include "tests/random.h"
#include "tests/server/collision/random_cell.h"

namespace silhouette {

// A table that reads what another one holds, but for the configurations in `lost`.
inline RobotImageTable ReadFrom(const RobotImageTable& held, const std::set<uint64_t>& lost = {}) {
  const std::vector<MaskSize> sizes(held.mask_sizes().begin(), held.mask_sizes().end());
  RobotImageTable::Builder builder(
      held.grid(), sizes, [&held, lost](ConfigurationNumber number, std::span<uint64_t> words) {
        return !lost.contains(number) && held.Read(number, words);
      });
  std::vector<uint64_t> words(held.words());
  for (ConfigurationNumber number = 0; number < held.grid().number_limit(); ++number) {
    const RobotImageState state = held.state(number);
    if (state == RobotImageState::kMissing) continue;
    if (state != RobotImageState::kPresent) {
      builder.AddWithout(number, state);
      continue;
    }
    held.Read(number, words);
    builder.Add(number, words);
  }
  return std::move(builder).Build();
}

struct TableInPlace : ::testing::Test {
  Random random;

  ConfigurationGrid Grid() {
    return ConfigurationGrid({{.name = "a", .lower = 0, .upper = 1, .steps = 20},
                              {.name = "b", .lower = 0, .upper = 6, .steps = 12},
                              {.name = "c", .lower = 0, .upper = 3, .steps = 5}});
  }

  // Anywhere, also outside; on the grid as often as between its values.
  Configuration AnyConfiguration(const ConfigurationGrid& grid) {
    Configuration q;
    for (const GridJoint& joint : grid.joints()) {
      const double place = std::uniform_real_distribution(-0.2, joint.steps - 0.9)(random);
      q.push_back(joint.lower + joint.step() * (random() % 2 == 0 ? place : std::floor(place)));
    }
    return q;
  }
};

}  // namespace silhouette
