#include "db/index/tile_index.h"

#include <bit>
#include <stdexcept>

#include "db/index/tile_bytes.h"

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

constexpr PlaceSet kNoPlaces;

// How many sets there are before that of a node in its word.
uint64_t RankOf(uint64_t some, uint64_t bit) {
  return static_cast<uint64_t>(std::popcount(some & (bit - 1)));
}

}  // namespace

TileIndex::TileIndex(std::span<const std::byte> bytes, std::span<const PixelTree> trees,
                     const TileIndex* base)
    : trees_(trees), base_(base) {
  if (reinterpret_cast<uintptr_t>(bytes.data()) % 8 != 0) Malformed();
  if (base != nullptr && base->base_ != nullptr) Malformed();
  const uint64_t views = trees.size() | (base != nullptr ? kTellsDifferences : 0);
  if (TileIndexAt<uint64_t>(bytes, 0, 1)[0] != views) Malformed();
  const auto offsets = TileIndexAt<uint64_t>(bytes, 8, trees.size());
  const uint64_t present_at = RoundedUp(8 + 8 * trees.size());
  present_ = TileIndexAt<PlaceSet>(bytes, present_at, 1).data();
  views_.reserve(trees.size());
  for (size_t view = 0; view < trees.size(); ++view) {
    views_.push_back(ViewIn(bytes, offsets[view], trees[view]));
  }
}

TileIndex::View TileIndex::ViewIn(std::span<const std::byte> bytes, uint64_t offset,
                                  const PixelTree& tree) const {
  const auto counts = TileIndexAt<uint64_t>(bytes, offset, 2);
  if (counts[0] != tree.words() || offset % 64 != 0) Malformed();
  View view;
  view.words = TileIndexAt<Word>(bytes, offset + 16, counts[0]);
  uint64_t sets = 0;
  for (const Word& word : view.words) {
    if (word.before != sets || (word.some & word.all) != 0) Malformed();
    sets += static_cast<uint64_t>(std::popcount(word.some));
  }
  if (sets != counts[1]) Malformed();
  const uint64_t words_end = offset + 16 + counts[0] * sizeof(Word);
  if (base_ == nullptr) {
    view.sets = TileIndexAt<PlaceSet>(bytes, RoundedUp(words_end), sets).data()->words.data();
    return view;
  }
  view.differences = TileIndexAt<uint64_t>(bytes, words_end, sets);
  uint64_t lines = 0;
  for (const uint64_t difference : view.differences) {
    if (difference >> kLines != lines) Malformed();
    lines += static_cast<uint64_t>(std::popcount(difference & kLinesMask));
  }
  const uint64_t lines_at = RoundedUp(words_end + sets * sizeof(uint64_t));
  if (lines_at > bytes.size() || lines > (bytes.size() - lines_at) / (kLineWords * 8)) Malformed();
  view.lines = reinterpret_cast<const uint64_t*>(bytes.data() + lines_at);
  return view;
}

bool TileIndex::AnyTouches(int view, const Nodes& nodes) const {
  const std::span<const Word> words = views_[static_cast<size_t>(view)].words;
  for (const NodeWord& at : nodes) {
    if (((words[at.word].some | words[at.word].all) & at.bits) != 0) return true;
  }
  return false;
}

void TileIndex::AddTouching(int view, const Nodes& nodes, PlaceSet& touching,
                            const Unions& unions) const {
  if (base_ != nullptr) {
    return AddTouchingByDifferences(static_cast<size_t>(view), nodes, touching, unions);
  }
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
        unions.add(in.sets, chosen, touching);
        count = 0;
      }
      chosen[count++] = static_cast<uint32_t>(word.before + rank);
    }
  }
  if (count > 0) unions.add(in.sets, {chosen.data(), count}, touching);
}

const uint64_t* TileIndex::SetOf(const View& view, size_t word, uint64_t bit) const {
  const Word& at = view.words[word];
  if ((at.some & bit) != 0) {
    return view.sets + PlaceSet::kWords * (at.before + RankOf(at.some, bit));
  }
  return ((at.all & bit) != 0 ? *present_ : kNoPlaces).words.data();
}

SetDifference TileIndex::DifferenceOf(size_t view, size_t word, uint64_t bit, size_t set) const {
  const View& in = views_[view];
  const uint64_t difference = in.differences[set];
  return {.base = base_->SetOf(base_->views_[view], word, bit),
          .lines = in.lines + kLineWords * (difference >> kLines),
          .differing = difference & kLinesMask};
}

void TileIndex::AddTouchingByDifferences(size_t view, const Nodes& nodes, PlaceSet& touching,
                                         const Unions& unions) const {
  const View& in = views_[view];
  std::array<SetDifference, 64> chosen;
  size_t count = 0;
  for (const NodeWord& at : nodes) {
    const Word& word = in.words[at.word];
    if ((word.all & at.bits) != 0) {
      touching |= present();
      return;
    }
    for (uint64_t left = word.some & at.bits; left != 0; left &= left - 1) {
      const uint64_t bit = left & (~left + 1);
      if (count == chosen.size()) {
        unions.add_differences(chosen, touching);
        count = 0;
      }
      chosen[count++] = DifferenceOf(view, at.word, bit, word.before + RankOf(word.some, bit));
    }
  }
  if (count > 0) unions.add_differences({chosen.data(), count}, touching);
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
      const uint64_t word =
          base_ == nullptr ? in.sets[PlaceSet::kWords * set + place / 64]
                           : DifferenceOf(static_cast<size_t>(view), i, bit, set).Word(place / 64);
      if ((word >> (place % 64) & 1) != 0) image[i] |= bit;
    }
  }
  // The last word has nodes of the next level behind the pixels.
  const size_t used = size.pixels() % 64;
  if (used != 0) image.back() &= (uint64_t{1} << used) - 1;
  return Mask::FromWords(size, std::move(image));
}

}  // namespace silhouette
