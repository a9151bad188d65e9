// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <type_traits>

#include "db/index/tile_index.h"

namespace silhouette {
namespace {

template <typename T>
void Append(std::vector<std::byte>& bytes, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  const size_t at = bytes.size();
  bytes.resize(at + sizeof(T));
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

void FillUp(std::vector<std::byte>& bytes) { bytes.resize((bytes.size() + 63) / 64 * 64); }

// Transposes 64 x 64 bits: bit i of word j becomes bit j of word i.
void Transpose(uint64_t* words) {
  uint64_t mask = 0x00000000ffffffff;
  for (unsigned width = 32; width != 0; width /= 2, mask ^= mask << width) {
    for (unsigned i = 0; i < 64; i = ((i | width) + 1) & ~width) {
      const uint64_t swapped = ((words[i] >> width) ^ words[i + width]) & mask;
      words[i] ^= swapped << width;
      words[i + width] ^= swapped;
    }
  }
}

}  // namespace

TileIndexBuilder::TileIndexBuilder(std::span<const PixelTree> trees)
    : trees_(trees), views_(trees.size()) {
  for (size_t i = 0; i < trees.size(); ++i) {
    const size_t words = trees[i].size().words();
    views_[i].pending.assign(64 * words, 0);
    views_[i].touched.assign(words, 0);
    views_[i].slots.assign(trees[i].nodes(), 0);
  }
}

void TileIndexBuilder::Add(uint64_t place, std::span<const MaskWords> images) {
  if (place >= kTileSize || place < next_place_ || images.size() != views_.size()) {
    throw std::invalid_argument("a tile's places come in order, with an image per view");
  }
  for (size_t i = 0; i < images.size(); ++i) {
    if (images[i].size() != views_[i].touched.size()) {
      throw std::invalid_argument("an image has not the size of its view's masks");
    }
  }
  if (place / 64 != next_place_ / 64) Flush();
  next_place_ = place;
  for (size_t i = 0; i < images.size(); ++i) {
    View& view = views_[i];
    for (size_t word = 0; word < images[i].size(); ++word) {
      const uint64_t bits = images[i][word];
      if (bits == 0) continue;
      view.pending[64 * word + place % 64] = bits;
      view.touched[word] |= bits;
    }
  }
  present_.Insert(place);
  ++next_place_;
  if (next_place_ % 64 == 0) Flush();
}

PlaceSet& TileIndexBuilder::SetOf(View& view, size_t node) {
  if (view.slots[node] == 0) {
    view.sets.emplace_back();
    view.slots[node] = static_cast<uint32_t>(view.sets.size());
  }
  return view.sets[view.slots[node] - 1];
}

// Takes what is pending into the sets of the pixels. A second call changes nothing.
void TileIndexBuilder::Flush() {
  if (next_place_ == 0) return;
  const size_t column = (next_place_ - 1) / 64;
  for (View& view : views_) {
    for (size_t word = 0; word < view.touched.size(); ++word) {
      if (view.touched[word] == 0) continue;
      uint64_t* block = view.pending.data() + 64 * word;
      Transpose(block);
      for (uint64_t left = view.touched[word]; left != 0; left &= left - 1) {
        const auto bit = static_cast<size_t>(std::countr_zero(left));
        SetOf(view, 64 * word + bit).words[column] = block[bit];
      }
      std::fill_n(block, 64, uint64_t{0});
      view.touched[word] = 0;
    }
  }
}

// The sets of the nodes above the pixels.
void TileIndexBuilder::AddLevels(const PixelTree& tree, View& view) const {
  for (int level = 1; level < tree.levels(); ++level) {
    const MaskSize below = tree.level_size(level - 1);
    for (int y = 0; y < below.height; ++y) {
      for (int x = 0; x < below.width; ++x) {
        const uint32_t slot = view.slots[tree.NodeOf(level - 1, x, y)];
        if (slot == 0) continue;
        PlaceSet& above = SetOf(view, tree.NodeOf(level, x / 2, y / 2));
        above |= view.sets[slot - 1];
      }
    }
  }
}

void TileIndexBuilder::AppendView(const PixelTree& tree, const View& view,
                                  std::vector<std::byte>& bytes) const {
  std::vector<uint32_t> stored;
  std::vector<uint64_t> words(3 * tree.words(), 0);
  for (size_t node = 0; node < tree.nodes(); ++node) {
    uint64_t* word = words.data() + 3 * (node / 64);
    if (node % 64 == 0) word[2] = stored.size();
    if (view.slots[node] == 0) continue;
    const bool all = view.sets[view.slots[node] - 1] == present_;
    word[all ? 1 : 0] |= uint64_t{1} << (node % 64);
    if (!all) stored.push_back(view.slots[node] - 1);
  }
  Append(bytes, uint64_t{tree.words()});
  Append(bytes, uint64_t{stored.size()});
  for (const uint64_t word : words) Append(bytes, word);
  FillUp(bytes);
  bytes.reserve(bytes.size() + stored.size() * sizeof(PlaceSet));
  for (const uint32_t set : stored) Append(bytes, view.sets[set]);
}

std::vector<std::byte> TileIndexBuilder::Finish() {
  Flush();
  std::vector<std::byte> bytes;
  Append(bytes, uint64_t{views_.size()});
  bytes.resize(8 + 8 * views_.size());
  FillUp(bytes);
  Append(bytes, present_);
  for (size_t i = 0; i < views_.size(); ++i) {
    AddLevels(trees_[i], views_[i]);
    FillUp(bytes);
    const uint64_t offset = bytes.size();
    std::memcpy(bytes.data() + 8 + 8 * i, &offset, sizeof offset);
    AppendView(trees_[i], views_[i], bytes);
    std::ranges::fill(views_[i].slots, 0);
    views_[i].sets.clear();
  }
  present_ = {};
  next_place_ = 0;
  return bytes;
}

}  // namespace silhouette
