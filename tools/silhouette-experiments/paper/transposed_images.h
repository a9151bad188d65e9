// The robot images of a view the other way round: per pixel, the configurations in which the robot
// covers it. The verdict on all configurations is then the union of a few sets.
#pragma once

#include <span>
#include <vector>

#include "db/mask/mask.h"
#include "tools/silhouette-experiments/paper/configuration_set.h"

namespace silhouette::paper {

class TransposedImages {
 public:
  // One image per configuration, at least one, all of one size; else std::invalid_argument.
  explicit TransposedImages(std::span<const Mask> images);

  size_t configurations() const { return configurations_; }
  size_t words() const { return WordsFor(configurations_); }
  MaskSize mask_size() const { return mask_size_; }

  // The configurations whose image has the pixel.
  ConfigurationWords Covering(size_t pixel) const {
    return {bits_.data() + pixel * words(), words()};
  }

 private:
  size_t configurations_;
  MaskSize mask_size_;
  std::vector<uint64_t> bits_;
};

// Calls visit(pixel) for every set pixel.
template <typename Visit>
void ForEachPixel(MaskWords words, Visit visit) {
  for (size_t word = 0; word < words.size(); ++word) {
    for (uint64_t bits = words[word]; bits != 0; bits &= bits - 1) {
      visit(word * 64 + static_cast<size_t>(std::countr_zero(bits)));
    }
  }
}

}  // namespace silhouette::paper
