// The epipolar bands from one view into another, as masks: which pixels of the other view may show
// the same point as a pixel of this one. Pixels with the same band share it.
#pragma once

#include <cstdint>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/epipolar_bands.h"

namespace silhouette::paper {

class LineTable {
 public:
  // From `view` into `other`, another view of `bands`.
  LineTable(const EpipolarBands& bands, int view, int other);

  size_t lines() const { return masks_.size() / words_; }
  // The line of a pixel of the view.
  size_t LineOf(size_t pixel) const { return line_of_[pixel]; }
  // The pixels of the other view on a line.
  MaskWords Band(size_t line) const { return {masks_.data() + line * words_, words_}; }

 private:
  size_t words_;
  std::vector<uint16_t> line_of_;
  std::vector<uint64_t> masks_;
};

}  // namespace silhouette::paper
