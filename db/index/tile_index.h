// SPDX-License-Identifier: Apache-2.0
// The collision index of one tile: its robot images transposed. Part of the pure core.
//
// Per view and node of the view's pixel tree, the set of the tile's configurations whose robot
// image touches the node. Most sets are empty or hold every configuration that is there; only the
// others are stored. Level 0 of the tree gives the robot images back: nothing is lost.
//
// Bytes, integers little-endian:
//   offset  size  content
//   0       8     n, number of views
//   8       8 n   per view the offset of its part, a multiple of 64
//   ...           0 up to a multiple of 64
//   ...     512   the configurations that have robot images (PlaceSet)
//   then the parts of the views, each:
//   0       8     w, number of words of a bit per node
//   8       8     s, number of sets
//   16      24 w  per word: the nodes whose set is stored; the nodes whose set holds all
//                 configurations; how many sets are stored for the words before it
//   ...           0 up to a multiple of 64
//   ...     512 s the sets, in the order of their nodes
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "db/index/pixel_tree.h"
#include "db/index/place_set.h"
#include "db/mask/mask.h"

namespace silhouette {

// Refers to the bytes and to the trees, which must outlive it. Used by any number of threads.
// Copies what says where sets lie: bytes that change later make answers wrong, but no access leaves
// them.
class TileIndex {
 public:
  // `bytes`: as above, at an address that is a multiple of 8 (of 64: faster). `trees`: one per
  // view. Throws std::invalid_argument if the bytes are not the index of such views.
  TileIndex(std::span<const std::byte> bytes, std::span<const PixelTree> trees);

  int views() const { return static_cast<int>(views_.size()); }

  // The configurations that have robot images.
  const PlaceSet& present() const { return present_; }

  // Adds to `touching` the configurations whose robot image touches one of the nodes. Never
  // allocates.
  void AddTouching(int view, const Nodes& nodes, PlaceSet& touching,
                   AddUnion add_union = BestUnion()) const;

  // Whether AddTouching would add any.
  bool AnyTouches(int view, const Nodes& nodes) const;

  // The robot image of a place that is present.
  Mask Image(int view, uint64_t place) const;

 private:
  struct Word {
    uint64_t some;
    uint64_t all;
    uint64_t before;
  };
  struct View {
    std::vector<Word> words;
    const uint64_t* sets = nullptr;
  };

  static View ViewIn(std::span<const std::byte> bytes, uint64_t offset, const PixelTree& tree);

  std::span<const PixelTree> trees_;
  PlaceSet present_;
  std::vector<View> views_;
};

// Builds the index of one tile after another. Memory: what the index takes, and the images of 64
// configurations.
class TileIndexBuilder {
 public:
  // `trees`: one per view, which must outlive the builder.
  explicit TileIndexBuilder(std::span<const PixelTree> trees);

  // The robot images of a place, one per view, as mask words. Places come in ascending order.
  // Throws std::invalid_argument if they do not, or if the images do not fit the views.
  void Add(uint64_t place, std::span<const MaskWords> images);

  // The bytes of the index; the builder begins a new tile.
  std::vector<std::byte> Finish();

 private:
  struct View {
    // The images of 64 places, word by word: the 64 words i of the places from 64 i on.
    std::vector<uint64_t> pending;
    std::vector<uint64_t> touched;  // the union of those images
    // Per node 1 + the place of its set in `sets`; 0: no configuration touches it yet.
    std::vector<uint32_t> slots;
    std::vector<PlaceSet> sets;
  };

  static PlaceSet& SetOf(View& view, size_t node);
  void Flush();
  void AddLevels(const PixelTree& tree, View& view) const;
  void AppendView(const PixelTree& tree, const View& view, std::vector<std::byte>& bytes) const;

  std::span<const PixelTree> trees_;
  std::vector<View> views_;
  PlaceSet present_;
  uint64_t next_place_ = 0;
};

}  // namespace silhouette
