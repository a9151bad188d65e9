// SPDX-License-Identifier: Apache-2.0
// The moves from a grid point to its neighbours, and what they cost.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "clients/planners/wave_propagation.h"
#include "db/mask/configuration_grid.h"

namespace silhouette {

// Length in grid steps as a whole number of 2^-32: sums do not depend on their order, so equal
// lengths are equal.
using Cost = uint64_t;
inline constexpr int kCostBits = 32;
inline constexpr Cost kUnreached = ~Cost{0};

// `steps` >= 0.
Cost CostOfSteps(double steps);
double StepsOfCost(Cost cost);

struct Move {
  std::array<int, kMaxJoints> steps{};  // -1, 0 or 1 along each joint
  Cost cost = 0;
  // The moves that leave out one of this one's joints, as indices into the set. Their boxes and
  // this one's end are together this one's box.
  std::vector<int> parts = {};
  // The move of one joint that the first of the parts leaves out.
  int rest = -1;
};

// Moves in the order in which ties are broken; the parts of a move come before it.
std::vector<Move> MoveSet(const ConfigurationGrid& grid, Moves moves);

// Where `move` leads from `index`; nothing beyond the grid's rim.
std::optional<GridIndex> After(const ConfigurationGrid& grid, const GridIndex& index,
                               const Move& move);

}  // namespace silhouette
