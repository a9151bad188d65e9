// SPDX-License-Identifier: Apache-2.0
// A set of configurations of one tile. Part of the pure core.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "db/mask/configuration_grid.h"

namespace silhouette {

// Bit i % 64 of word i / 64 for place i of the tile.
struct alignas(64) PlaceSet {
  static constexpr size_t kWords = kTileSize / 64;

  std::array<uint64_t, kWords> words{};

  bool operator==(const PlaceSet&) const = default;

  bool Contains(uint64_t place) const { return (words[place / 64] >> (place % 64) & 1) != 0; }
  void Insert(uint64_t place) { words[place / 64] |= uint64_t{1} << (place % 64); }
  bool Empty() const;

  PlaceSet& operator|=(const PlaceSet& other);
  PlaceSet& operator&=(const PlaceSet& other);
  // Takes the places of `other` away.
  PlaceSet& operator-=(const PlaceSet& other);
};

// The instruction sets that unions are made with.
enum class InstructionSet { kBaseline, kAvx2, kAvx512 };

// Those that this machine has, the best one last.
std::vector<InstructionSet> InstructionSets();

// Adds to `result` the sets of PlaceSet::kWords words each that stand at `sets` + kWords * i, for
// every i of `chosen`. The words need not be aligned, but are read faster if they are to 64 bytes.
// Never allocates.
using AddUnion = void (*)(const uint64_t* sets, std::span<const uint32_t> chosen, PlaceSet& result);

// The one for an instruction set, which the machine must have.
AddUnion UnionWith(InstructionSet set);
// The fastest one of this machine.
AddUnion BestUnion();

}  // namespace silhouette
