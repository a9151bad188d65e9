// SPDX-License-Identifier: Apache-2.0
// Random numbers of the simulated cell: the same for a seed everywhere, which the distributions of
// the standard library do not promise.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace silhouette {

class Chance {
 public:
  explicit Chance(uint64_t seed) : random_(seed) {}

  // In (0, 1).
  double Uniform() { return (static_cast<double>(random_() >> 11) + 0.5) * 0x1p-53; }
  double Uniform(double lower, double upper) { return lower + (upper - lower) * Uniform(); }

  // From 0 up to, but without `count`.
  size_t Index(size_t count) { return static_cast<size_t>(Uniform() * static_cast<double>(count)); }

  // Normally distributed with mean 0 and standard deviation 1.
  double Normal() {
    const double radius = std::sqrt(-2 * std::log(Uniform()));
    return radius * std::cos(2 * std::numbers::pi * Uniform());
  }
  Eigen::Vector3d NormalVector() {
    const double x = Normal();
    const double y = Normal();
    return {x, y, Normal()};
  }
  // A direction, all alike likely; unit length.
  Eigen::Vector3d Direction() { return NormalVector().normalized(); }

 private:
  std::mt19937_64 random_;
};

}  // namespace silhouette
