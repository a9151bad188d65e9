// SPDX-License-Identifier: Apache-2.0
// PlaneDistances: how far the pixels of a view are from what its plane shows. Uses the standard
// library alone.
//
// Cannot be changed once made; used by any number of threads. Two bytes a pixel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "db/mask/mask.h"

namespace silhouette {

class PlaneDistances {
 public:
  // Distances above are taken for this one.
  static constexpr int kMost = 64;   // pixels
  static constexpr int kUnits = 32;  // a pixel

  explicit PlaneDistances(const Mask& plane);
  PlaneDistances() = default;

  // By pixel (Mask's number): units from its centre to the nearest square of a set one, rounded
  // down; 0 in a set one.
  std::span<const uint16_t> units() const { return distances_; }

 private:
  std::vector<uint16_t> distances_;
};

}  // namespace silhouette
