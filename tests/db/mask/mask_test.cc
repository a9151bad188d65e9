// SPDX-License-Identifier: Apache-2.0
// Masks against a vector of pixels, one at a time.
#include "db/mask/mask.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/random.h"

namespace silhouette {
namespace {

struct Pixels {
  MaskSize size;
  std::vector<bool> set;

  bool at(int x, int y) const { return set[static_cast<size_t>(y * size.width + x)]; }
};

Pixels RandomPixels(MaskSize size, std::mt19937_64& random) {
  Pixels pixels{size, std::vector<bool>(size.pixels())};
  const uint64_t one_in = 1 + random() % 4;
  for (size_t i = 0; i < size.pixels(); ++i) pixels.set[i] = random() % one_in == 0;
  return pixels;
}

Mask MaskOf(const Pixels& pixels) {
  return Mask::FromPredicate(pixels.size, [&](int x, int y) { return pixels.at(x, y); });
}

void ExpectEqual(const Mask& mask, MaskSize size, const std::function<bool(int, int)>& expected) {
  ASSERT_EQ(mask.size(), size);
  size_t count = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      ASSERT_EQ(mask.at(x, y), expected(x, y)) << x << ", " << y;
      count += expected(x, y) ? 1 : 0;
    }
  }
  EXPECT_EQ(mask.Count(), count);
  EXPECT_EQ(mask.Empty(), count == 0);
}

// Every size that a word, a byte or a row can end in, and a few at random.
std::vector<MaskSize> SomeSizes(std::mt19937_64& random) {
  std::vector<MaskSize> sizes = {{1, 1}, {64, 1}, {1, 64}, {65, 1},
                                 {7, 9}, {8, 8},  {63, 3}, {64, 64}};
  for (int i = 0; i < 30; ++i) {
    sizes.push_back({1 + static_cast<int>(random() % 100), 1 + static_cast<int>(random() % 100)});
  }
  sizes.push_back({1024, 3});
  return sizes;
}

class RandomMasks : public testing::Test {
 protected:
  Random random_;
};

TEST_F(RandomMasks, HoldThePixelsTheyWereMadeOf) {
  for (MaskSize size : SomeSizes(random_)) {
    const Pixels pixels = RandomPixels(size, random_);
    ExpectEqual(MaskOf(pixels), size, [&](int x, int y) { return pixels.at(x, y); });
    ExpectEqual(Mask(size), size, [](int, int) { return false; });
  }
}

TEST_F(RandomMasks, CombineAsTheirPixelsDo) {
  for (MaskSize size : SomeSizes(random_)) {
    const Pixels p = RandomPixels(size, random_);
    const Pixels q = RandomPixels(size, random_);
    const Mask a = MaskOf(p);
    const Mask b = MaskOf(q);
    ExpectEqual(a & b, size, [&](int x, int y) { return p.at(x, y) && q.at(x, y); });
    ExpectEqual(a | b, size, [&](int x, int y) { return p.at(x, y) || q.at(x, y); });
    ExpectEqual(a - b, size, [&](int x, int y) { return p.at(x, y) && !q.at(x, y); });
    ExpectEqual(~a, size, [&](int x, int y) { return !p.at(x, y); });
    EXPECT_EQ(Intersects(a.words(), b.words()), !(a & b).Empty());
    EXPECT_EQ(CountCommon(a.words(), b.words()), (a & b).Count());
    EXPECT_EQ(a == b, p.set == q.set);
  }
}

TEST_F(RandomMasks, KeepInTheirCoreWhatHasAllItsNeighbours) {
  for (MaskSize size : SomeSizes(random_)) {
    Pixels pixels = RandomPixels(size, random_);
    for (size_t i = 0; i < size.pixels(); ++i) {  // nearly full, or no core would be left
      pixels.set[i] = pixels.set[i] || random_() % 8 != 0;
    }
    ExpectEqual(Core(MaskOf(pixels)), size, [&](int x, int y) {
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) {
          const bool outside =
              x + i < 0 || y + j < 0 || x + i >= size.width || y + j >= size.height;
          if (!outside && !pixels.at(x + i, y + j)) return false;
        }
      }
      return true;
    });
  }
}

TEST_F(RandomMasks, HaveTheDocumentedBitsAndBytes) {
  for (MaskSize size : SomeSizes(random_)) {
    const Pixels pixels = RandomPixels(size, random_);
    const Mask mask = MaskOf(pixels);
    const std::string bytes = mask.ToBytes();
    ASSERT_EQ(bytes.size(), (size.pixels() + 7) / 8);
    for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
      const bool expected = bit < size.pixels() && pixels.set[bit];
      ASSERT_EQ((static_cast<uint8_t>(bytes[bit / 8]) >> (bit % 8) & 1) != 0, expected) << bit;
      ASSERT_EQ((mask.words()[bit / 64] >> (bit % 64) & 1) != 0, expected) << bit;
    }
    EXPECT_EQ(Mask::FromBytes(size, {reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}),
              mask);
    EXPECT_EQ(Mask::FromWords(size, {mask.words().begin(), mask.words().end()}), mask);
  }
}

template <typename Action>
std::string MessageOf(Action action) {
  try {
    action();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(Mask, RefusesSizesThatNoViewHas) {
  for (MaskSize size : {MaskSize{0, 1}, {1, 0}, {-1, 5}, {1025, 1}, {1, 1025}}) {
    EXPECT_FALSE(size.valid());
    const std::string expected = "mask size " + std::to_string(size.width) + "x" +
                                 std::to_string(size.height) + " is not within 1x1 to 1024x1024";
    EXPECT_EQ(MessageOf([&] { Mask mask(size); }), expected);
    EXPECT_EQ(MessageOf([&] { Mask::FromWords(size, {}); }), expected);
    EXPECT_EQ(MessageOf([&] { Mask::FromBytes(size, {}); }), expected);
  }
  EXPECT_TRUE((MaskSize{1024, 1024}).valid());
  EXPECT_EQ(Mask({1024, 1024}).ToBytes().size(), 128 * 1024);
}

TEST(Mask, RefusesBitsThatAreNoPixels) {
  const std::vector<uint8_t> two_bytes = {0, 0};
  const std::vector<uint8_t> stray = {0xff, 0x02};
  EXPECT_EQ(MessageOf([&] {
              Mask::FromBytes({3, 3}, std::span(two_bytes).first(1));
            }),
            "a mask of this size takes 2 bytes, not 1");
  EXPECT_EQ(MessageOf([&] {
              Mask::FromBytes({3, 3}, stray);
            }),
            "a bit beyond the mask's last pixel is set");
  EXPECT_EQ(MessageOf([&] {
              Mask::FromWords({3, 3}, {1 << 9});
            }),
            "a bit beyond the mask's last pixel is set");
  EXPECT_EQ(MessageOf([&] {
              Mask::FromWords({3, 3}, {1, 0});
            }),
            "a mask of this size takes 1 words, not 2");
}

TEST(Mask, RefusesToCombineDifferentSizesAndToLookOutside) {
  EXPECT_EQ(MessageOf([] { Mask({8, 8}) & Mask({4, 16}); }), "masks of different sizes");
  EXPECT_EQ(MessageOf([] { Mask({8, 8}) | Mask({4, 16}); }), "masks of different sizes");
  EXPECT_EQ(MessageOf([] { Mask({8, 8}) - Mask(); }), "masks of different sizes");
  const Mask mask({4, 3});
  for (const auto& [x, y] : {std::pair(-1, 0), {0, -1}, {4, 0}, {0, 3}}) {
    EXPECT_THROW((void)mask.at(x, y), std::out_of_range);
  }
}

TEST(Mask, OfNoPixelsIsEmpty) {
  EXPECT_TRUE(Mask().Empty());
  EXPECT_EQ(Mask().Count(), 0);
  EXPECT_EQ(Mask() | Mask(), Mask());
  EXPECT_EQ(~Mask(), Mask());
  EXPECT_EQ(Core(Mask()), Mask());
  EXPECT_NE(Mask(), Mask({1, 1}));
}

// How far the squares of two pixels are apart, from the definition.
double Apart(int dx, int dy) {
  return std::hypot(std::max(std::abs(dx) - 1, 0), std::max(std::abs(dy) - 1, 0));
}

TEST(GrownMask, HasThePixelsNearerThanTheRadiusAndNoOthers) {
  Random random;
  for (int round = 0; round < 60; ++round) {
    const MaskSize size{1 + static_cast<int>(random() % 140), 1 + static_cast<int>(random() % 40)};
    const double radius = round % 4 == 0 ? round / 8.0 : 0.1 + random() % 900 / 100.0;
    const Mask mask = Mask::FromPredicate(size, [&](int, int) { return random() % 150 == 0; });
    const Mask expected = Mask::FromPredicate(size, [&](int x, int y) {
      for (int v = 0; v < size.height; ++v) {
        for (int u = 0; u < size.width; ++u) {
          if (mask.at(u, v) && (Apart(u - x, v - y) < radius || (u == x && v == y))) return true;
        }
      }
      return false;
    });
    ASSERT_EQ(Grown(mask, radius), expected)
        << size.width << "x" << size.height << ", radius " << radius;
  }
}

TEST(GrownMask, NoRadiusChangesNothingAndAHugeOneFillsTheImage) {
  const Mask mask = Mask::FromPredicate({70, 9}, [](int x, int y) { return x == 3 && y == 2; });
  EXPECT_EQ(Grown(mask, 0), mask);
  EXPECT_EQ(Grown(mask, -1), mask);
  EXPECT_EQ(Grown(mask, 1e9), ~Mask({70, 9}));
  EXPECT_EQ(Grown(Mask({70, 9}), 1e9), Mask({70, 9}));
  EXPECT_EQ(Grown(Mask(), 3), Mask());
  EXPECT_THROW(Grown(mask, std::nan("")), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
