// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/indexed_cell.h"

#include <array>
#include <atomic>
#include <cstring>
#include <span>
#include <utility>

#include "common/parallel/parallel.h"

namespace silhouette::benchmarks {
namespace {

std::vector<PixelTree> TreesFor(std::span<const MaskSize> sizes) {
  return {sizes.begin(), sizes.end()};
}

uint64_t BytesOfMasks(std::span<const MaskSize> sizes) {
  uint64_t bytes = 0;
  for (const MaskSize size : sizes) bytes += size.words() * sizeof(uint64_t);
  return bytes;
}

}  // namespace

void IndexedCell::Append(const std::vector<std::byte>& bytes) {
  std::vector<PlaceSet>& kept = kept_.emplace_back(bytes.size() / sizeof(PlaceSet) + 1);
  std::memcpy(kept.data(), bytes.data(), bytes.size());
  tiles_.emplace_back(std::as_bytes(std::span(kept)).first(bytes.size()), trees_);
  bytes_ += bytes.size();
}

IndexedCell::IndexedCell(const SyntheticCell& cell, uint64_t stride)
    : IndexedCell(cell.mask_sizes(), (cell.grid().tiles() + stride - 1) / stride,
                  [&](size_t i, TileIndexBuilder& builder) {
                    uint64_t configurations = 0;
                    const TileMasks masks = cell.RenderTile(i * stride);
                    std::array<MaskWords, kViews> images;
                    for (uint64_t place = 0; place < kTileSize; ++place) {
                      if (!masks.present(place)) continue;
                      for (int view = 0; view < kViews; ++view) {
                        images[static_cast<size_t>(view)] = masks.mask(view, place);
                      }
                      builder.Add(place, images);
                      ++configurations;
                    }
                    return configurations;
                  }) {}

IndexedCell::IndexedCell(std::span<const MaskSize> sizes, uint64_t tiles, const AddTile& add)
    : trees_(TreesFor(sizes)) {
  std::atomic<uint64_t> configurations = 0;
  std::vector<std::vector<std::byte>> built(tiles);
  ParallelFor(tiles, [&](size_t i) {
    TileIndexBuilder builder(trees_);
    configurations += add(i, builder);
    built[i] = builder.Finish();
  });
  for (std::vector<std::byte>& bytes : built) Append(std::exchange(bytes, {}));
  configurations_ = configurations;
  mask_bytes_ = configurations * BytesOfMasks(sizes);
}

}  // namespace silhouette::benchmarks
