#include "tools/silhouette-experiments/paper/transposed_images.h"

#include <stdexcept>

namespace silhouette::paper {

TransposedImages::TransposedImages(std::span<const Mask> images) : configurations_(images.size()) {
  if (images.empty()) throw std::invalid_argument("there are no images to transpose");
  mask_size_ = images[0].size();
  bits_.assign(mask_size_.pixels() * words(), 0);
  for (size_t i = 0; i < images.size(); ++i) {
    if (images[i].size() != mask_size_) {
      throw std::invalid_argument("images to transpose are of different sizes");
    }
    ForEachPixel(images[i].words(),
                 [&](size_t pixel) { bits_[pixel * words() + i / 64] |= uint64_t{1} << (i % 64); });
  }
}

}  // namespace silhouette::paper
