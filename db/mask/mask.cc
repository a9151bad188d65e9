// SPDX-License-Identifier: Apache-2.0
#include "db/mask/mask.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

void MaskRequireValid(MaskSize size) {
  if (!size.valid()) {
    throw std::invalid_argument("mask size " + std::to_string(size.width) + "x" +
                                std::to_string(size.height) + " is not within 1x1 to 1024x1024");
  }
}

void RequireSameSize(const Mask& a, const Mask& b) {
  if (a.size() != b.size()) throw std::invalid_argument("masks of different sizes");
}

// The bits of the last word that belong to pixels.
uint64_t LastWordBits(MaskSize size) {
  const size_t used = size.pixels() % 64;
  return used == 0 ? ~uint64_t{0} : (uint64_t{1} << used) - 1;
}

template <typename Operation>
Mask Combine(const Mask& a, const Mask& b, Operation operation) {
  RequireSameSize(a, b);
  std::vector<uint64_t> words(a.words().size());
  std::transform(a.words().begin(), a.words().end(), b.words().begin(), words.begin(), operation);
  return words.empty() ? Mask() : Mask::FromWords(a.size(), std::move(words));
}

// Rows of bits that begin at a word's begin each.
class AlignedRows {
 public:
  explicit AlignedRows(MaskSize size)
      : size_(size),
        words_per_row_(static_cast<size_t>(size.width + 63) / 64),
        words_(words_per_row_ * static_cast<size_t>(size.height)) {}

  explicit AlignedRows(const Mask& mask) : AlignedRows(mask.size()) {
    const auto width = static_cast<size_t>(size_.width);
    for (size_t y = 0; y < static_cast<size_t>(size_.height); ++y) {
      for (size_t i = 0; i < words_per_row_; ++i) {
        row(y)[i] = BitsFrom(mask.words(), y * width + 64 * i) & InRow(i);
      }
    }
  }

  std::span<uint64_t> row(size_t y) { return {words_.data() + y * words_per_row_, words_per_row_}; }

  Mask ToMask() {
    std::vector<uint64_t> packed(size_.words() + 1);
    const auto width = static_cast<size_t>(size_.width);
    for (size_t y = 0; y < static_cast<size_t>(size_.height); ++y) {
      for (size_t i = 0; i < words_per_row_; ++i) {
        const uint64_t bits = row(y)[i] & InRow(i);
        const size_t at = y * width + 64 * i;
        if (bits == 0) continue;
        packed[at / 64] |= bits << (at % 64);
        if (at % 64 != 0) packed[at / 64 + 1] |= bits >> (64 - at % 64);
      }
    }
    packed.pop_back();
    return Mask::FromWords(size_, std::move(packed));
  }

 private:
  // 64 bits from bit `at` on; zeros beyond the end.
  static uint64_t BitsFrom(MaskWords words, size_t at) {
    const size_t word = at / 64;
    if (word >= words.size()) return 0;
    uint64_t bits = words[word] >> (at % 64);
    if (at % 64 != 0 && word + 1 < words.size()) bits |= words[word + 1] << (64 - at % 64);
    return bits;
  }

  // The bits of a row's word that are pixels.
  uint64_t InRow(size_t word) const {
    const size_t used = static_cast<size_t>(size_.width) - 64 * word;
    return used >= 64 ? ~uint64_t{0} : (uint64_t{1} << used) - 1;
  }

  const MaskSize size_;
  const size_t words_per_row_;
  std::vector<uint64_t> words_;
};

// Sets every bit with a set bit at most `reach` before or after it.
void Widen(std::span<uint64_t> row, int reach) {
  for (int i = 0; i < reach; ++i) {
    uint64_t before = 0;
    for (size_t word = 0; word < row.size(); ++word) {
      const uint64_t bits = row[word];
      const uint64_t after = word + 1 < row.size() ? row[word + 1] : 0;
      row[word] = bits | bits << 1 | bits >> 1 | before >> 63 | after << 63;
      before = bits;
    }
  }
}

}  // namespace

bool MaskSize::valid() const {
  return width >= 1 && width <= kMaxSide && height >= 1 && height <= kMaxSide;
}

Mask::Mask(MaskSize size) : size_(size) {
  MaskRequireValid(size);
  words_.resize(size.words());
}

Mask Mask::FromPredicate(MaskSize size, const std::function<bool(int, int)>& predicate) {
  Mask mask(size);
  size_t bit = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x, ++bit) {
      if (predicate(x, y)) mask.words_[bit / 64] |= uint64_t{1} << (bit % 64);
    }
  }
  return mask;
}

Mask Mask::FromWords(MaskSize size, std::vector<uint64_t> words) {
  MaskRequireValid(size);
  if (words.size() != size.words()) {
    throw std::invalid_argument("a mask of this size takes " + std::to_string(size.words()) +
                                " words, not " + std::to_string(words.size()));
  }
  if ((words.back() & ~LastWordBits(size)) != 0) {
    throw std::invalid_argument("a bit beyond the mask's last pixel is set");
  }
  Mask mask;
  mask.size_ = size;
  mask.words_ = std::move(words);
  return mask;
}

Mask Mask::FromBytes(MaskSize size, std::span<const uint8_t> bytes) {
  MaskRequireValid(size);
  if (bytes.size() != size.bytes()) {
    throw std::invalid_argument("a mask of this size takes " + std::to_string(size.bytes()) +
                                " bytes, not " + std::to_string(bytes.size()));
  }
  std::vector<uint64_t> words(size.words());
  if constexpr (std::endian::native == std::endian::little) {
    std::memcpy(words.data(), bytes.data(), bytes.size());
  } else {
    for (size_t i = 0; i < bytes.size(); ++i) {
      words[i / 8] |= static_cast<uint64_t>(bytes[i]) << (8 * (i % 8));
    }
  }
  return FromWords(size, std::move(words));
}

std::string Mask::ToBytes() const {
  std::string bytes(size_.bytes(), '\0');
  if constexpr (std::endian::native == std::endian::little) {
    std::memcpy(bytes.data(), words_.data(), bytes.size());
  } else {
    for (size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<char>(words_[i / 8] >> (8 * (i % 8)));
    }
  }
  return bytes;
}

bool Mask::at(int x, int y) const {
  if (x < 0 || y < 0 || x >= size_.width || y >= size_.height) {
    throw std::out_of_range("pixel outside the mask");
  }
  const size_t bit = static_cast<size_t>(y) * static_cast<size_t>(size_.width) + x;
  return (words_[bit / 64] >> (bit % 64)) & 1;
}

size_t Mask::Count() const { return CountCommon(words_, words_); }

bool Mask::Empty() const {
  return std::all_of(words_.begin(), words_.end(), [](uint64_t word) { return word == 0; });
}

Mask operator&(const Mask& a, const Mask& b) { return Combine(a, b, std::bit_and<>()); }

Mask operator|(const Mask& a, const Mask& b) { return Combine(a, b, std::bit_or<>()); }

Mask operator-(const Mask& a, const Mask& b) {
  return Combine(a, b, [](uint64_t x, uint64_t y) { return x & ~y; });
}

Mask operator~(const Mask& a) {
  if (a.words().empty()) return a;
  std::vector<uint64_t> words(a.words().begin(), a.words().end());
  for (uint64_t& word : words) word = ~word;
  words.back() &= LastWordBits(a.size());
  return Mask::FromWords(a.size(), std::move(words));
}

bool Intersects(MaskWords a, MaskWords b) {
  for (size_t i = 0; i < a.size(); ++i) {
    if ((a[i] & b[i]) != 0) return true;
  }
  return false;
}

size_t CountCommon(MaskWords a, MaskWords b) {
  size_t count = 0;
  for (size_t i = 0; i < a.size(); ++i) count += std::popcount(a[i] & b[i]);
  return count;
}

bool TouchesBorder(const Mask& mask) {
  for (int x = 0; x < mask.width(); ++x) {
    if (mask.at(x, 0) || mask.at(x, mask.height() - 1)) return true;
  }
  for (int y = 0; y < mask.height(); ++y) {
    if (mask.at(0, y) || mask.at(mask.width() - 1, y)) return true;
  }
  return false;
}

Mask Core(const Mask& mask) {
  if (mask.words().empty()) return mask;
  return Mask::FromPredicate(mask.size(), [&](int x, int y) {
    for (int j = std::max(y - 1, 0); j <= std::min(y + 1, mask.height() - 1); ++j) {
      for (int i = std::max(x - 1, 0); i <= std::min(x + 1, mask.width() - 1); ++i) {
        if (!mask.at(i, j)) return false;
      }
    }
    return true;
  });
}

Mask Grown(const Mask& mask, double radius) {
  if (!std::isfinite(radius)) throw std::invalid_argument("a radius must be finite");
  if (!(radius > 0) || mask.words().empty()) return mask;
  const int height = mask.height();
  const int most = mask.width() + height;  // no pixel is farther away
  radius = std::min<double>(radius, most);
  AlignedRows from(mask);
  AlignedRows grown(mask.size());
  // Widened step by step: the farther away a row is, the less it is widened. Squares that touch are
  // at distance 0.
  int widened = 0;
  const int rows = static_cast<int>(std::ceil(radius));
  for (int away = rows; away >= 0; --away) {
    const double between = std::max(away - 1, 0);
    const int reach = static_cast<int>(std::ceil(std::sqrt(radius * radius - between * between)));
    for (int y = 0; y < height; ++y) Widen(from.row(static_cast<size_t>(y)), reach - widened);
    widened = reach;
    for (int y = 0; y < height; ++y) {
      for (int target : {y - away, y + away}) {
        if (target < 0 || target >= height) continue;
        const std::span<uint64_t> to = grown.row(static_cast<size_t>(target));
        const std::span<uint64_t> row = from.row(static_cast<size_t>(y));
        for (size_t i = 0; i < to.size(); ++i) to[i] |= row[i];
      }
    }
  }
  return grown.ToMask();
}

}  // namespace silhouette
