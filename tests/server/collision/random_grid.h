// SPDX-License-Identifier: Apache-2.0
// Random grids, and robots that move through them, for tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "server/collision/robot_image_table.h"
#include "tests/random.h"

namespace silhouette {

// Of several tiles as a rule, most of them with absent places, any of the joints continuous.
inline ConfigurationGrid RandomGrid(int joints, std::mt19937_64& random) {
  for (;;) {
    std::vector<int> edges(static_cast<size_t>(joints), 1);
    for (int i = 0; i < 12; ++i) edges[random() % edges.size()] *= 2;
    std::vector<GridJoint> made;
    double size = 1;
    double padded = 1;
    for (size_t j = 0; j < edges.size(); ++j) {
      const int most = 2 * edges[j] + 2;
      GridJoint joint{.name = std::string(1, static_cast<char>('a' + j))};
      joint.steps = 1 + static_cast<int>(random() % static_cast<unsigned>(most));
      joint.continuous = joint.steps >= 3 && random() % 2 == 0;
      joint.lower = -1;
      joint.upper = joint.steps == 1 ? -1 : joint.continuous ? -1 + 2 * std::numbers::pi : 2;
      size *= joint.steps;
      padded *= (joint.steps + edges[j] - 1) / edges[j];
      made.push_back(std::move(joint));
    }
    if (size > 9000 || padded > 64) continue;
    return ConfigurationGrid(std::move(made), std::move(edges));
  }
}

// A box of pixels that each joint moves in every view; now and then outside, and without an image
// at a few configurations.
inline RobotImageTable MovingTable(const ConfigurationGrid& grid,
                                   const std::vector<MaskSize>& sizes, std::mt19937_64& random) {
  RobotImageTable::Builder builder(grid, sizes, grid.size());
  std::uniform_real_distribution<double> part(-1, 1);
  std::vector<std::vector<double>> ways;  // per view along x and y, in images over the joint
  for (size_t i = 0; i < 2 * sizes.size(); ++i) {
    std::vector<double> way;
    for (int j = 0; j < grid.dimensions(); ++j) way.push_back(part(random));
    ways.push_back(way);
  }
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    const auto index = grid.IndexOf(number);
    if (!index) continue;
    const auto chance = random() % 1000;
    if (chance == 0) continue;
    if (chance == 1) {
      builder.AddWithout(number, RobotImageState::kExcluded);
      continue;
    }
    if (chance == 2) {
      builder.AddWithout(number, RobotImageState::kCorrupt);
      continue;
    }
    std::vector<Mask> masks;
    for (size_t view = 0; view < sizes.size(); ++view) {
      double x = 0.5;
      double y = 0.5;
      for (int j = 0; j < grid.dimensions(); ++j) {
        const auto joint = static_cast<size_t>(j);
        const double way = static_cast<double>((*index)[joint]) / grid.joints()[joint].steps;
        x += way * ways[2 * view][joint];
        y += way * ways[2 * view + 1][joint];
      }
      const int left = static_cast<int>(std::floor(x * sizes[view].width));
      const int top = static_cast<int>(std::floor(y * sizes[view].height));
      masks.push_back(Mask::FromPredicate(sizes[view], [&](int column, int row) {
        return column >= left && column <= left + 1 && row >= top && row <= top + 1;
      }));
    }
    builder.Add(number, masks);
  }
  return std::move(builder).Build();
}

}  // namespace silhouette
