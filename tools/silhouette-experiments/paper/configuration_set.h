// Sets of configurations as bits, one per configuration: what a whole configuration space is
// worked on with at once.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace silhouette::paper {

// Bit i % 64 of word i / 64 is configuration i; unused bits are zero.
using ConfigurationSet = std::vector<uint64_t>;
using ConfigurationWords = std::span<const uint64_t>;

inline size_t WordsFor(size_t configurations) { return (configurations + 63) / 64; }

inline bool Contains(ConfigurationWords set, size_t configuration) {
  return (set[configuration / 64] >> (configuration % 64) & 1) != 0;
}

inline void Insert(ConfigurationSet& set, size_t configuration) {
  set[configuration / 64] |= uint64_t{1} << (configuration % 64);
}

inline void Add(ConfigurationSet& set, ConfigurationWords other) {
  for (size_t i = 0; i < set.size(); ++i) set[i] |= other[i];
}

inline int64_t Count(ConfigurationWords set) {
  int64_t count = 0;
  for (uint64_t word : set) count += std::popcount(word);
  return count;
}

// How many are in `a` and not in `b`.
inline int64_t CountWithout(ConfigurationWords a, ConfigurationWords b) {
  int64_t count = 0;
  for (size_t i = 0; i < a.size(); ++i) count += std::popcount(a[i] & ~b[i]);
  return count;
}

}  // namespace silhouette::paper
