// SPDX-License-Identifier: Apache-2.0
#include "db/index/pixel_tree.h"

#include <algorithm>
#include <array>
#include <span>
#include <stdexcept>

namespace silhouette {
namespace {

bool PixelTreeAt(std::span<const uint64_t> bits, size_t i) {
  return (bits[i / 64] >> (i % 64) & 1) != 0;
}
void Insert(std::span<uint64_t> bits, size_t i) { bits[i / 64] |= uint64_t{1} << (i % 64); }
void Remove(std::span<uint64_t> bits, size_t i) { bits[i / 64] &= ~(uint64_t{1} << (i % 64)); }

}  // namespace

PixelTree::PixelTree(MaskSize size) {
  if (!size.valid()) throw std::invalid_argument("a mask size is not valid");
  for (;;) {
    levels_.push_back({size, nodes_});
    nodes_ += size.pixels();
    if (size.pixels() == 1) return;
    size = {(size.width + 1) / 2, (size.height + 1) / 2};
  }
}

Nodes PixelTree::Cover(const Mask& mask) const {
  if (mask.size() != size()) throw std::invalid_argument("the mask has not the size of the tree");
  std::vector<uint64_t> bits(words(), 0);
  // The pixels are the first nodes, in the order of a mask's bits.
  std::copy(mask.words().begin(), mask.words().end(), bits.begin());
  for (int level = 1; level < levels(); ++level) {
    const MaskSize here = level_size(level);
    const MaskSize below = level_size(level - 1);
    bool any = false;
    for (int y = 0; y < here.height; ++y) {
      for (int x = 0; x < here.width; ++x) {
        const int right = std::min(2 * x + 1, below.width - 1);
        const int bottom = std::min(2 * y + 1, below.height - 1);
        // At the rim some of them are the same.
        const std::array<size_t, 4> children = {
            NodeOf(level - 1, 2 * x, 2 * y), NodeOf(level - 1, right, 2 * y),
            NodeOf(level - 1, 2 * x, bottom), NodeOf(level - 1, right, bottom)};
        if (!std::ranges::all_of(children, [&](size_t child) { return PixelTreeAt(bits, child); }))
          continue;
        Insert(bits, NodeOf(level, x, y));
        for (const size_t child : children) Remove(bits, child);
        any = true;
      }
    }
    if (!any) break;
  }
  Nodes nodes;
  for (size_t i = 0; i < bits.size(); ++i) {
    if (bits[i] != 0) nodes.push_back({static_cast<uint32_t>(i), bits[i]});
  }
  return nodes;
}

}  // namespace silhouette
