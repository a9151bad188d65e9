// SPDX-License-Identifier: Apache-2.0
#include "db/index/tile_index.h"

#include <bit>
#include <stdexcept>

namespace silhouette {
namespace {

static_assert(std::endian::native == std::endian::little, "the index is read in place");

[[noreturn]] void Malformed() {
  throw std::invalid_argument("these bytes are not the collision index of such a tile");
}

// `count` values of a type at an offset, if they are within the bytes and aligned.
template <typename T>
std::span<const T> TileIndexAt(std::span<const std::byte> bytes, uint64_t offset, uint64_t count) {
  if (offset % 8 != 0 || offset > bytes.size() || count > (bytes.size() - offset) / sizeof(T)) {
    Malformed();
  }
  return {reinterpret_cast<const T*>(bytes.data() + offset), count};
}

uint64_t RoundedUp(uint64_t offset) { return (offset + 63) / 64 * 64; }

// How many sets there are before that of a node in its word.
uint64_t RankOf(uint64_t some, uint64_t bit) {
  return static_cast<uint64_t>(std::popcount(some & (bit - 1)));
}

}  // namespace

TileIndex::TileIndex(std::span<const std::byte> bytes, std::span<const PixelTree> trees)
    : trees_(trees) {
  if (reinterpret_cast<uintptr_t>(bytes.data()) % 8 != 0) Malformed();
  if (TileIndexAt<uint64_t>(bytes, 0, 1)[0] != trees.size()) Malformed();
  const auto offsets = TileIndexAt<uint64_t>(bytes, 8, trees.size());
  const uint64_t present_at = RoundedUp(8 + 8 * trees.size());
  present_ = TileIndexAt<PlaceSet>(bytes, present_at, 1)[0];
  views_.reserve(trees.size());
  for (size_t view = 0; view < trees.size(); ++view) {
    views_.push_back(ViewIn(bytes, offsets[view], trees[view]));
  }
}

TileIndex::View TileIndex::ViewIn(std::span<const std::byte> bytes, uint64_t offset,
                                  const PixelTree& tree) {
  const auto counts = TileIndexAt<uint64_t>(bytes, offset, 2);
  if (counts[0] != tree.words() || offset % 64 != 0) Malformed();
  View view;
  const auto words = TileIndexAt<Word>(bytes, offset + 16, tree.words());
  view.words.assign(words.begin(), words.end());
  uint64_t sets = 0;
  for (const Word& word : view.words) {
    if (word.before != sets || (word.some & word.all) != 0) Malformed();
    sets += static_cast<uint64_t>(std::popcount(word.some));
  }
  if (sets != counts[1]) Malformed();
  const uint64_t words_end = offset + 16 + view.words.size() * sizeof(Word);
  view.sets = TileIndexAt<PlaceSet>(bytes, RoundedUp(words_end), sets).data()->words.data();
  return view;
}

bool TileIndex::AnyTouches(int view, const Nodes& nodes) const {
  const std::vector<Word>& words = views_[static_cast<size_t>(view)].words;
  for (const NodeWord& at : nodes) {
    if (((words[at.word].some | words[at.word].all) & at.bits) != 0) return true;
  }
  return false;
}

void TileIndex::AddTouching(int view, const Nodes& nodes, PlaceSet& touching,
                            AddUnion add_union) const {
  const View& in = views_[static_cast<size_t>(view)];
  std::array<uint32_t, 256> chosen;
  size_t count = 0;
  for (const NodeWord& at : nodes) {
    const Word& word = in.words[at.word];
    if ((word.all & at.bits) != 0) {
      touching |= present();
      return;
    }
    for (uint64_t left = word.some & at.bits; left != 0; left &= left - 1) {
      const uint64_t rank = RankOf(word.some, left & (~left + 1));
      if (count == chosen.size()) {
        add_union(in.sets, chosen, touching);
        count = 0;
      }
      chosen[count++] = static_cast<uint32_t>(word.before + rank);
    }
  }
  if (count > 0) add_union(in.sets, {chosen.data(), count}, touching);
}

Mask TileIndex::Image(int view, uint64_t place) const {
  const View& in = views_[static_cast<size_t>(view)];
  const MaskSize size = trees_[static_cast<size_t>(view)].size();
  std::vector<uint64_t> image(size.words(), 0);
  for (size_t i = 0; i < image.size(); ++i) {
    image[i] = in.words[i].all;
    size_t set = in.words[i].before;
    for (uint64_t left = in.words[i].some; left != 0; left &= left - 1, ++set) {
      const uint64_t bit = left & (~left + 1);
      const uint64_t word = in.sets[PlaceSet::kWords * set + place / 64];
      if ((word >> (place % 64) & 1) != 0) image[i] |= bit;
    }
  }
  // The last word has nodes of the next level behind the pixels.
  const size_t used = size.pixels() % 64;
  if (used != 0) image.back() &= (uint64_t{1} << used) - 1;
  return Mask::FromWords(size, std::move(image));
}

}  // namespace silhouette
