// SPDX-License-Identifier: Apache-2.0
// The collision index of a synthesised cell whose masks would not fit into memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "db/index/pixel_tree.h"
#include "db/index/place_set.h"
#include "db/index/tile_index.h"
#include "tests/benchmark/synthetic_cell.h"

namespace silhouette::benchmarks {

class IndexedCell {
 public:
  // Renders the cell's tiles and indexes them, each `stride`th tile, with as many threads as the
  // machine has cores. The masks are never in memory all at once.
  explicit IndexedCell(const SyntheticCell& cell, uint64_t stride = 1);
  // Indexes `tiles` tiles likewise. `add`: adds the configurations of the i-th; how many they are.
  using AddTile = std::function<uint64_t(size_t i, TileIndexBuilder& builder)>;
  IndexedCell(std::span<const MaskSize> sizes, uint64_t tiles, const AddTile& add);
  IndexedCell(const IndexedCell&) = delete;
  IndexedCell& operator=(const IndexedCell&) = delete;

  const std::vector<PixelTree>& trees() const { return trees_; }
  const std::vector<TileIndex>& tiles() const { return tiles_; }
  uint64_t configurations() const { return configurations_; }
  // Of the index.
  uint64_t bytes() const { return bytes_; }
  // Of the masks that it was made of.
  uint64_t mask_bytes() const { return mask_bytes_; }

 private:
  void Append(const std::vector<std::byte>& bytes);

  std::vector<PixelTree> trees_;
  // The bytes of the tiles, at multiples of 64 as the index likes them.
  std::vector<std::vector<PlaceSet>> kept_;
  std::vector<TileIndex> tiles_;
  uint64_t configurations_ = 0;
  uint64_t bytes_ = 0;
  uint64_t mask_bytes_ = 0;
};

}  // namespace silhouette::benchmarks
