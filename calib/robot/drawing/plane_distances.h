// SPDX-License-Identifier: Apache-2.0
// PlaneDistances: how far the pixels of a view are from what its plane shows. Uses the standard
// library alone.
//
// Cannot be changed once made; used by any number of threads. Two bytes a pixel.
#pragma once

#include <cstddef>
#include <cstdint>
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

  // Pixels from the centre of a pixel (Mask's number) to the nearest square of a set one; 0 in a
  // set one. Up to 1/32 less than it is, never more.
  float At(size_t pixel) const { return static_cast<float>(distances_[pixel]) * (1.0F / kUnits); }
  int UnitsAt(size_t pixel) const { return distances_[pixel]; }

 private:
  std::vector<uint16_t> distances_;
};

}  // namespace silhouette
