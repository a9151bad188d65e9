// How far every pixel of a view is from the set pixels of a plane.
//
// Distances are those of Grown (db/mask/mask.h), between the squares of pixels, in pixels: 0 for
// set pixels and their eight neighbours. They are kept squared, as whole numbers, and so are exact.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "db/mask/mask.h"

namespace silhouette {

// Cannot be changed once made; read by any number of threads.
class DistanceImage {
 public:
  // The squared distance from a plane without set pixels.
  static constexpr uint32_t kInfinite = std::numeric_limits<uint32_t>::max();

  // Takes time in proportion to the number of pixels. Throws std::invalid_argument for a mask of no
  // size.
  explicit DistanceImage(const Mask& plane);

  MaskSize size() const { return size_; }

  // The least squared distance of the pixels that are set in `pixels`, words of a mask of the same
  // size; kInfinite if none is. Never allocates.
  uint32_t LeastSquared(MaskWords pixels) const;

  // The pixels at no more than this squared distance.
  Mask Within(uint32_t squared) const;

 private:
  MaskSize size_;
  std::vector<uint32_t> squared_;  // by pixel
};

// The distance in pixels of a squared distance, infinity for kInfinite; so rounded that Grown by it
// does not reach a pixel at that distance, and by anything greater, up to rounding, does.
double PixelsOf(uint32_t squared);

}  // namespace silhouette
