// SPDX-License-Identifier: Apache-2.0
// Random numbers for tests that try something new every time.
#pragma once

#include <cstdint>
#include <iostream>
#include <random>

namespace silhouette {

// With a new seed, which it prints: with that seed a failure comes again.
inline std::mt19937_64 SeededRandom() {
  const uint64_t seed = std::random_device()();
  std::cout << "seed " << seed << std::endl;
  return std::mt19937_64(seed);
}

}  // namespace silhouette
