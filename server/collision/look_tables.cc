#include "server/collision/look_tables.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <span>
#include <utility>

namespace silhouette {
namespace {

constexpr uint8_t kSaysNothing =
    LookTables::kPossible | LookTables::kObstacle | LookTables::kAllowed;
// While a table is made, in the place of kAllowed: a pixel that is neither background nor allowed.
constexpr uint8_t kNotAllowed = LookTables::kAllowed;

// out[i] = a[i] | b[i], eight at a time.
void Or(const uint8_t* a, const uint8_t* b, size_t count, uint8_t* out) {
  size_t i = 0;
  for (; i + 8 <= count; i += 8) {
    uint64_t of_a = 0;
    uint64_t of_b = 0;
    std::memcpy(&of_a, a + i, 8);
    std::memcpy(&of_b, b + i, 8);
    of_a |= of_b;
    std::memcpy(out + i, &of_a, 8);
  }
  for (; i < count; ++i) out[i] = a[i] | b[i];
}

void Flip(uint8_t* bytes, size_t count, uint8_t bits) {
  for (size_t i = 0; i < count; ++i) bytes[i] ^= bits;
}

// `row` moved so that place x holds what was at x + by; what comes in from outside is set.
void AndMoved(std::span<const uint64_t> row, int by, int width, std::span<uint64_t> out) {
  const auto bits = [&](int place) {  // 64 bits from `place`, of whatever lies there
    const auto word = [&](int64_t i) {
      return i < 0 || i >= static_cast<int64_t>(row.size()) ? ~uint64_t{0}
                                                            : row[static_cast<size_t>(i)];
    };
    const int64_t at = place < 0 ? (place - 63) / 64 : place / 64;
    const auto shift = static_cast<unsigned>(place - at * 64);
    return shift == 0 ? word(at) : word(at) >> shift | word(at + 1) << (64 - shift);
  };
  for (size_t i = 0; i < out.size(); ++i) {
    const int place = static_cast<int>(i) * 64;
    if (place < width) out[i] &= bits(place + by);
  }
}

}  // namespace

LookTables::LookTables(const VoxelSpace::Look& look, const std::optional<ObstacleImage>& image,
                       const std::optional<Mask>& allowed)
    : width_(look.mask_size.width) {
  if (!image) {
    touched_.assign(1 + look.kinds.size() * look.mask_size.pixels(), kPossible | kObstacle);
    const size_t bits =
        look.shapes.size() * static_cast<size_t>(look.mask_size.height) * look.row_bits();
    certain_.assign(bits / 64, ~uint64_t{0});
    return;
  }
  FillTouched(look, *image, allowed);
  const Mask foreground = image->obstacle() | image->unknown() | image->error();
  FillCertain(look, foreground);
  const auto stride = static_cast<size_t>(width_) + 1;
  sums_.assign(stride * (static_cast<size_t>(look.mask_size.height) + 1), 0);
  const MaskWords words = foreground.words();
  for (int y = 0; y < look.mask_size.height; ++y) {
    uint32_t in_row = 0;
    for (int x = 0; x < width_; ++x) {
      const auto bit = static_cast<size_t>(y * width_ + x);
      in_row += static_cast<uint32_t>(words[bit / 64] >> (bit % 64) & 1);
      const size_t corner = static_cast<size_t>(y + 1) * stride + static_cast<size_t>(x) + 1;
      sums_[corner] = sums_[corner - stride] + in_row;
    }
  }
}

void LookTables::FillTouched(const VoxelSpace::Look& look, const ObstacleImage& image,
                             const std::optional<Mask>& allowed) {
  const size_t pixels = look.mask_size.pixels();
  int widest = 1;
  for (const auto& kind : look.kinds) widest = std::max(widest, kind.width);
  // For rectangles of one row and 1, 2, ... pixels, by their first pixel.
  std::vector<uint8_t> rows(static_cast<size_t>(widest) * pixels, 0);
  const MaskWords obstacle = image.obstacle().words();
  const MaskWords unknown = image.unknown().words();
  const MaskWords error = image.error().words();
  for (size_t i = 0; i < pixels; ++i) {
    const auto bit = [i](MaskWords words) { return (words[i / 64] >> (i % 64) & 1) != 0; };
    if (!bit(obstacle) && !bit(unknown) && !bit(error)) continue;
    rows[i] = kPossible | (bit(obstacle) ? kObstacle : 0) |
              (allowed && bit(allowed->words()) ? 0 : kNotAllowed);
  }
  for (size_t width = 2; width <= static_cast<size_t>(widest); ++width) {
    uint8_t* out = rows.data() + (width - 1) * pixels;
    Or(out - pixels, rows.data() + (width - 1), pixels - (width - 1), out);
  }
  touched_.assign(1 + look.kinds.size() * pixels, kSaysNothing);
  const auto stride = static_cast<size_t>(width_);
  for (size_t i = 0; i < look.kinds.size(); ++i) {
    const VoxelSpace::RectangleKind& kind = look.kinds[i];
    if (!kind.whole) continue;
    const uint8_t* row = rows.data() + static_cast<size_t>(kind.width - 1) * pixels;
    uint8_t* out = touched_.data() + 1 + i * pixels;
    std::copy(row, row + pixels, out);
    for (size_t below = 1; below < static_cast<size_t>(kind.height); ++below) {
      Or(out, row + below * stride, pixels - below * stride, out);
    }
    Flip(out, pixels, kNotAllowed);
  }
}

void LookTables::FillCertain(const VoxelSpace::Look& look, const Mask& foreground) {
  const auto height = static_cast<size_t>(look.mask_size.height);
  const size_t row_words = look.row_bits() / 64;
  const size_t image_words = height * row_words;
  // The foreground, set also where there is no image.
  std::vector<uint64_t> padded(image_words, ~uint64_t{0});
  const MaskWords words = foreground.words();
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < static_cast<size_t>(width_); ++x) {
      const size_t bit = y * static_cast<size_t>(width_) + x;
      if ((words[bit / 64] >> (bit % 64) & 1) != 0) continue;
      padded[y * row_words + x / 64] &= ~(uint64_t{1} << (x % 64));
    }
  }
  // The image in which a pixel is set if all pixels from `first` to `last` of its row are.
  std::map<std::pair<int, int>, std::vector<uint64_t>> runs;
  const auto run_image = [&](int first, int last) -> const std::vector<uint64_t>& {
    const auto [place, added] = runs.try_emplace({first, last});
    if (!added) return place->second;
    place->second.assign(image_words, ~uint64_t{0});
    for (size_t y = 0; y < height; ++y) {
      const std::span row(padded.data() + y * row_words, row_words);
      const std::span out(place->second.data() + y * row_words, row_words);
      for (int by = first; by <= last; ++by) AndMoved(row, by, width_, out);
    }
    return place->second;
  };
  certain_.assign(look.shapes.size() * image_words, ~uint64_t{0});
  for (size_t i = 0; i < look.shapes.size(); ++i) {
    uint64_t* out = certain_.data() + i * image_words;
    for (const PixelRun& run : look.shapes[i]) {
      const std::vector<uint64_t>& of_run = run_image(run.first, run.last);
      const auto above = static_cast<size_t>(std::max(0, -run.dy));
      const auto below = static_cast<size_t>(std::max<int>(0, run.dy));
      if (above >= height || below >= height) continue;
      const size_t moved = (height - above - below) * row_words;
      const uint64_t* from = of_run.data() + below * row_words;
      uint64_t* to = out + above * row_words;
      for (size_t word = 0; word < moved; ++word) to[word] &= from[word];
    }
  }
}

bool LookTables::AnyPossible(const PixelRectangle& pixels) const {
  if (sums_.empty() || !pixels.whole) return true;
  const auto stride = static_cast<size_t>(width_) + 1;
  const size_t top = static_cast<size_t>(pixels.y) * stride;
  const size_t bottom = static_cast<size_t>(pixels.y + pixels.height) * stride;
  const auto left = static_cast<size_t>(pixels.x);
  const auto right = static_cast<size_t>(pixels.x + pixels.width);
  return sums_[bottom + right] - sums_[bottom + left] - sums_[top + right] + sums_[top + left] != 0;
}

}  // namespace silhouette
