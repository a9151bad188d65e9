// SPDX-License-Identifier: Apache-2.0
// The collision index of a table of robot images, in memory.
#pragma once

#include <cstddef>
#include <vector>

#include "db/index/tile_index.h"
#include "server/collision/robot_image_table.h"

namespace silhouette {

class IndexOfTable {
 public:
  explicit IndexOfTable(const RobotImageTable& table) {
    for (const MaskSize size : table.mask_sizes()) trees_.emplace_back(size);
    TileIndexBuilder builder(trees_);
    for (uint64_t tile = 0; tile < table.grid().tiles(); ++tile) {
      for (uint64_t place = 0; place < kTileSize; ++place) {
        if (table.state(tile * kTileSize + place) != RobotImageState::kPresent) continue;
        std::vector<MaskWords> images;
        for (int view = 0; view < table.views(); ++view) {
          images.push_back(table.image(view, tile * kTileSize + place));
        }
        builder.Add(place, images);
      }
      bytes_.push_back(builder.Finish());
    }
    for (const std::vector<std::byte>& bytes : bytes_) tiles_.emplace_back(bytes, trees_);
  }
  IndexOfTable(const IndexOfTable&) = delete;
  IndexOfTable& operator=(const IndexOfTable&) = delete;

  const std::vector<PixelTree>& trees() const { return trees_; }
  const TileIndex& tile(uint64_t tile) const { return tiles_[tile]; }

 private:
  std::vector<PixelTree> trees_;
  std::vector<std::vector<std::byte>> bytes_;
  std::vector<TileIndex> tiles_;
};

}  // namespace silhouette
