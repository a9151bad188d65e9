// SPDX-License-Identifier: Apache-2.0
// Random numbers for tests.
#pragma once

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace silhouette {

// Begins with another seed each time. Failures report the seed, as long as this lives.
class Random : public std::mt19937 {
 public:
  Random() : Random(std::random_device{}()) {}
  explicit Random(unsigned seed)
      : std::mt19937(seed), trace_(__FILE__, __LINE__, "seed " + std::to_string(seed)) {}

 private:
  const ::testing::ScopedTrace trace_;
};

}  // namespace silhouette
