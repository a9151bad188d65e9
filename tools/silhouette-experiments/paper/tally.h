// Counting wrongly reported configurations over scenes and sets of cameras.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace silhouette::paper {

// Numbers of configurations: their sum, the least and the greatest.
struct Extent {
  int64_t sum = 0;
  int64_t least = std::numeric_limits<int64_t>::max();
  int64_t greatest = std::numeric_limits<int64_t>::min();

  void Add(int64_t value) {
    sum += value;
    least = std::min(least, value);
    greatest = std::max(greatest, value);
  }
  void Merge(const Extent& other) {
    sum += other.sum;
    least = std::min(least, other.least);
    greatest = std::max(greatest, other.greatest);
  }
};

// Of configurations: mean, least and greatest number over scenes and sets of cameras.
struct Spread {
  double mean = 0;
  int64_t least = 0;
  int64_t greatest = 0;
};

inline Spread SpreadOf(const Extent& extent, int64_t samples) {
  return {static_cast<double>(extent.sum) / static_cast<double>(samples), extent.least,
          extent.greatest};
}

struct Tally {
  int64_t samples = 0;  // scenes times sets of cameras
  Extent occupied;      // really
  Extent additional;
  Extent missing;

  void Merge(const Tally& other) {
    samples += other.samples;
    occupied.Merge(other.occupied);
    additional.Merge(other.additional);
    missing.Merge(other.missing);
  }
};

}  // namespace silhouette::paper
