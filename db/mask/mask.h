// SPDX-License-Identifier: Apache-2.0
// Mask: one bit per pixel of a view. Part of the pure core: no library is needed to read this.
//
// Pixels are numbered row by row from the top left, pixel (x, y) is bit y * width + x; bit i is
// bit i % 64 of word i / 64. There is no padding between rows; the unused bits of the last word
// are zero. The same bits, as little-endian bytes, are a mask's form on disk and on the wire.
//
// A mask cannot be changed once made, so it can be read by any number of threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace silhouette {

// Width and height of a mask in pixels, each 1 to kMaxSide.
struct MaskSize {
  static constexpr int kMaxSide = 1024;

  int width = 0;
  int height = 0;

  bool operator==(const MaskSize&) const = default;

  // Whether both sides are within 1..kMaxSide.
  bool valid() const;
  size_t pixels() const { return static_cast<size_t>(width) * static_cast<size_t>(height); }
  size_t words() const { return (pixels() + 63) / 64; }
  size_t bytes() const { return (pixels() + 7) / 8; }
};

// The bits of a mask without its size: what hot loops work on.
using MaskWords = std::span<const uint64_t>;

class Mask {
 public:
  // A mask of no pixels; it has no size that any view could have.
  Mask() = default;

  // A mask with no pixel set. Throws std::invalid_argument if `size` is not valid.
  explicit Mask(MaskSize size);

  // Pixel (x, y) is set where `predicate(x, y)` is true, for 0 <= x < width, 0 <= y < height.
  static Mask FromPredicate(MaskSize size, const std::function<bool(int x, int y)>& predicate);

  // Takes size.words() words. Throws std::invalid_argument if there are more or fewer, or if a bit
  // beyond the last pixel is set.
  static Mask FromWords(MaskSize size, std::vector<uint64_t> words);

  // Takes size.bytes() bytes, the form on disk and on the wire. Throws std::invalid_argument as
  // FromWords does.
  static Mask FromBytes(MaskSize size, std::span<const uint8_t> bytes);

  MaskSize size() const { return size_; }
  int width() const { return size_.width; }
  int height() const { return size_.height; }
  MaskWords words() const { return words_; }

  // The form on disk and on the wire: size().bytes() bytes.
  std::string ToBytes() const;

  // Whether pixel (x, y) is set. Throws std::out_of_range outside the mask.
  bool at(int x, int y) const;

  // Number of set pixels.
  size_t Count() const;
  bool Empty() const;

  bool operator==(const Mask&) const = default;

  // Pixel by pixel; both masks have the same size, else std::invalid_argument.
  friend Mask operator&(const Mask& a, const Mask& b);
  friend Mask operator|(const Mask& a, const Mask& b);
  // The pixels of `a` that are not in `b`.
  friend Mask operator-(const Mask& a, const Mask& b);
  // The pixels that are not set.
  friend Mask operator~(const Mask& a);

 private:
  MaskSize size_;
  std::vector<uint64_t> words_;
};

// Whether any bit is set in both. The spans have the same length. Never allocates.
bool Intersects(MaskWords a, MaskWords b);

// Number of bits set in both. The spans have the same length. Never allocates.
size_t CountCommon(MaskWords a, MaskWords b);

// Whether a pixel at the image's border is set.
bool TouchesBorder(const Mask& mask);

// The pixels that are set together with all their neighbours (3 x 3; pixels outside the image count
// as set): what is left of a plane without its rims.
Mask Core(const Mask& mask);

// The pixels whose squares are nearer than `radius` pixels to the square of a set pixel, the set
// ones included: wherever in its pixel a point of the mask may be, all points within the radius are
// in the result. A radius that is not above 0 leaves the mask as it is. Throws
// std::invalid_argument if the radius is not finite.
Mask Grown(const Mask& mask, double radius);

}  // namespace silhouette
