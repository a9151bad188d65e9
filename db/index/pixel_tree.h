// SPDX-License-Identifier: Apache-2.0
// The quadtree over the pixels of a mask. Part of the pure core.
//
// A node of level l covers the pixels [2^l x, 2^l (x + 1)) x [2^l y, 2^l (y + 1)), as far as they
// are in the mask: level 0 has the pixels, the last level has one node. Nodes are numbered level by
// level from the pixels up, row by row in each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "db/mask/mask.h"

namespace silhouette {

// Some nodes of a tree: those of the set bits of each word, bit i being node 64 * word + i. The
// words are in ascending order, none is 0.
struct NodeWord {
  uint32_t word = 0;
  uint64_t bits = 0;

  bool operator==(const NodeWord&) const = default;
};
using Nodes = std::vector<NodeWord>;

class PixelTree {
 public:
  // Throws std::invalid_argument if `size` is not valid.
  explicit PixelTree(MaskSize size);

  MaskSize size() const { return levels_.front().size; }
  int levels() const { return static_cast<int>(levels_.size()); }
  // Nodes along x and y.
  MaskSize level_size(int level) const { return levels_[static_cast<size_t>(level)].size; }
  size_t nodes() const { return nodes_; }
  // Words of a bit per node.
  size_t words() const { return (nodes_ + 63) / 64; }
  // The node of the last level, which covers all pixels.
  size_t root() const { return nodes_ - 1; }

  size_t NodeOf(int level, int x, int y) const {
    const Level& at = levels_[static_cast<size_t>(level)];
    return at.first + static_cast<size_t>(y) * static_cast<size_t>(at.size.width) +
           static_cast<size_t>(x);
  }

  // The fewest nodes that cover just the set pixels: every node all of whose pixels are set, unless
  // that holds of the node above it. Throws std::invalid_argument if the mask has another size.
  Nodes Cover(const Mask& mask) const;

 private:
  struct Level {
    MaskSize size;
    size_t first = 0;
  };

  std::vector<Level> levels_;
  size_t nodes_ = 0;
};

}  // namespace silhouette
