#include "tools/silhouette-experiments/paper/line_table.h"

#include <array>
#include <map>

namespace silhouette::paper {

LineTable::LineTable(const EpipolarBands& bands, int view, int other) {
  const MaskSize size = bands.mask_sizes()[static_cast<size_t>(other)];
  words_ = size.words();
  std::map<std::array<uint16_t, 4>, uint16_t> numbers;
  for (const EpipolarBands::Runs& runs : bands.runs(view, other)) {
    const auto pixel = static_cast<int>(line_of_.size());
    const std::array<uint16_t, 4> key = {runs[0].begin, runs[0].end, runs[1].begin, runs[1].end};
    const auto [found, is_new] = numbers.try_emplace(key, static_cast<uint16_t>(numbers.size()));
    line_of_.push_back(found->second);
    if (!is_new) continue;
    masks_.resize(masks_.size() + words_, 0);
    uint64_t* const mask = masks_.data() + masks_.size() - words_;
    for (size_t q = 0; q < size.pixels(); ++q) {
      if (bands.Meet(view, pixel, other, static_cast<int>(q))) {
        mask[q / 64] |= uint64_t{1} << (q % 64);
      }
    }
  }
}

}  // namespace silhouette::paper
