#include "server/collision/distance_image.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

// Per pixel, how many rows it is away from a set pixel of its column; `far` where there is none.
std::vector<int> RowsAway(const Mask& mask, int far) {
  const auto width = static_cast<size_t>(mask.width());
  const auto height = static_cast<size_t>(mask.height());
  std::vector<int> away(width * height, far);
  const MaskWords words = mask.words();
  for (size_t word = 0; word < words.size(); ++word) {
    for (uint64_t bits = words[word]; bits != 0; bits &= bits - 1) {
      away[64 * word + static_cast<size_t>(std::countr_zero(bits))] = 0;
    }
  }
  for (size_t i = width; i < away.size(); ++i) away[i] = std::min(away[i], away[i - width] + 1);
  for (size_t i = away.size() - width; i-- > 0;) away[i] = std::min(away[i], away[i + width] + 1);
  return away;
}

// The lower envelope of the parabolas (x - i)^2 + away[i]^2, as the two-pass distance transforms of
// Meijster et al. and of Felzenszwalb and Huttenlocher find it.
class Envelope {
 public:
  explicit Envelope(size_t width) : lowest_(width) {}

  // `squared` gets, for every x of the row, the height of the envelope there.
  void Evaluate(std::span<const int> away, std::span<uint32_t> squared) {
    const int width = static_cast<int>(away.size());
    const auto height_at = [&](int x, int i) { return (x - i) * (x - i) + away[i] * away[i]; };
    // The first x from which parabola `right` is lower than `left`, which is not below it at 0.
    const auto begins = [&](int left, int right) {
      const int lead =
          right * right - left * left + away[right] * away[right] - away[left] * away[left];
      return lead / (2 * (right - left)) + 1;
    };
    size_t count = 0;
    for (int i = 0; i < width; ++i) {
      while (count > 0 && height_at(lowest_[count - 1].from, lowest_[count - 1].parabola) >
                              height_at(lowest_[count - 1].from, i)) {
        --count;
      }
      const int from = count == 0 ? 0 : begins(lowest_[count - 1].parabola, i);
      if (from < width) lowest_[count++] = {from, i};
    }
    for (int x = width; count-- > 0;) {
      const Piece& piece = lowest_[count];
      while (x > piece.from) {
        --x;
        squared[static_cast<size_t>(x)] = static_cast<uint32_t>(height_at(x, piece.parabola));
      }
    }
  }

 private:
  // Which parabola is lowest from an x on.
  struct Piece {
    int from = 0;
    int parabola = 0;
  };
  std::vector<Piece> lowest_;
};

}  // namespace

DistanceImage::DistanceImage(const Mask& plane) : size_(plane.size()) {
  if (!size_.valid()) throw std::invalid_argument("a mask of no size has no distances");
  squared_.assign(size_.pixels(), kInfinite);
  if (plane.Empty()) return;
  // The distance between two squares is that of the one's centre to the nearest centre of the
  // other's 3 x 3 surroundings.
  const std::vector<int> away = RowsAway(Grown(plane, 1), size_.width + size_.height);
  const auto width = static_cast<size_t>(size_.width);
  Envelope envelope(width);
  for (size_t row = 0; row < away.size(); row += width) {
    envelope.Evaluate(std::span(away).subspan(row, width), std::span(squared_).subspan(row, width));
  }
}

uint32_t DistanceImage::LeastSquared(MaskWords pixels) const {
  uint32_t least = kInfinite;
  for (size_t word = 0; word < pixels.size(); ++word) {
    for (uint64_t bits = pixels[word]; bits != 0; bits &= bits - 1) {
      const size_t pixel = 64 * word + static_cast<size_t>(std::countr_zero(bits));
      least = std::min(least, squared_[pixel]);
    }
    if (least == 0) break;
  }
  return least;
}

Mask DistanceImage::Within(uint32_t squared) const {
  std::vector<uint64_t> words(size_.words());
  for (size_t pixel = 0; pixel < squared_.size(); ++pixel) {
    words[pixel / 64] |= uint64_t{squared_[pixel] <= squared ? 1U : 0U} << (pixel % 64);
  }
  return Mask::FromWords(size_, std::move(words));
}

double PixelsOf(uint32_t squared) {
  if (squared == DistanceImage::kInfinite) return std::numeric_limits<double>::infinity();
  const double pixels = std::sqrt(static_cast<double>(squared));
  // Rounded down where its square would come out greater: Grown compares squares.
  return pixels * pixels > squared ? std::nextafter(pixels, 0.0) : pixels;
}

}  // namespace silhouette
