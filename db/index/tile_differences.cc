// An index told by its differences from another one.
#include <bit>
#include <cstring>

#include "db/index/tile_bytes.h"
#include "db/index/tile_index.h"

namespace silhouette {
namespace {

constexpr size_t kLinesPerSet = PlaceSet::kWords / kLineWords;
static_assert(kLinesPerSet <= kLines);

using Line = std::array<uint64_t, kLineWords>;

// Appends the lines that differ; returns which they are.
uint64_t AppendLines(const uint64_t* set, const uint64_t* base, std::vector<Line>& lines) {
  uint64_t differing = 0;
  for (size_t i = 0; i < kLinesPerSet; ++i) {
    Line line;
    uint64_t any = 0;
    for (size_t w = 0; w < kLineWords; ++w) {
      line[w] = set[kLineWords * i + w] ^ base[kLineWords * i + w];
      any |= line[w];
    }
    if (any == 0) continue;
    differing |= uint64_t{1} << i;
    lines.push_back(line);
  }
  return differing;
}

}  // namespace

std::vector<std::byte> TileIndex::DifferencesFrom(const TileIndex& base) const {
  std::vector<std::byte> bytes;
  Append(bytes, uint64_t{views_.size()} | kTellsDifferences);
  bytes.resize(8 + 8 * views_.size());
  FillUp(bytes);
  Append(bytes, present());
  for (size_t v = 0; v < views_.size(); ++v) {
    const View& view = views_[v];
    FillUp(bytes);
    const uint64_t offset = bytes.size();
    std::memcpy(bytes.data() + 8 + 8 * v, &offset, sizeof offset);
    std::vector<uint64_t> differences;
    std::vector<Line> lines;
    for (size_t word = 0; word < view.words.size(); ++word) {
      for (uint64_t left = view.words[word].some; left != 0; left &= left - 1) {
        const uint64_t bit = left & (~left + 1);
        const uint64_t before = lines.size();
        const uint64_t differing =
            AppendLines(SetOf(view, word, bit), base.SetOf(base.views_[v], word, bit), lines);
        differences.push_back(before << kLines | differing);
      }
    }
    Append(bytes, uint64_t{view.words.size()});
    Append(bytes, uint64_t{differences.size()});
    for (const Word& word : view.words) Append(bytes, word);
    for (const uint64_t difference : differences) Append(bytes, difference);
    FillUp(bytes);
    for (const Line& line : lines) Append(bytes, line);
  }
  return bytes;
}

}  // namespace silhouette
