// SPDX-License-Identifier: Apache-2.0
// Choosing some of many: greedy, with exchange.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace silhouette {

// How good a set of cameras is; counts over all scenes and test configurations.
struct Measures {
  int64_t tested = 0;
  int64_t occupied = 0;    // really
  int64_t missing = 0;     // reported free, really occupied
  int64_t additional = 0;  // reported occupied, really free

  // Fewer missing are better; among equals, fewer additional.
  bool BetterThan(const Measures& other) const {
    return missing != other.missing ? missing < other.missing : additional < other.additional;
  }
};

// Indices of candidates, in the order in which they were chosen.
using CameraSet = std::vector<int>;

// The measures of several sets.
using Evaluate = std::function<std::vector<Measures>(const std::vector<CameraSet>&)>;

// The best set found of one size.
struct Selection {
  CameraSet cameras;
  Measures measures;
};

// For every size from 1 to `count`, at most `candidates`: the best set of the size before with the
// best camera added to it; then, as long as that helps, one camera exchanged for another. Among
// equals the lowest numbers win, so that the same input gives the same sets. Stops, with the sizes
// finished by then, when `stop` says so.
std::vector<Selection> Select(int candidates, int count, const Evaluate& evaluate,
                              const std::function<bool()>& stop);

}  // namespace silhouette
