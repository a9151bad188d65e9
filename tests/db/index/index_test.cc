// SPDX-License-Identifier: Apache-2.0
// The collision index of a tile against its robot images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <random>

#include "db/index/tile_index.h"
#include "tests/random.h"

namespace silhouette {
namespace {

double Uniform(Random& random, double from, double to) {
  return std::uniform_real_distribution<double>(from, to)(random);
}

// A disc somewhere in or near the image.
Mask RandomDisc(Random& random, MaskSize size, double largest) {
  const double x0 = Uniform(random, -0.2, 1.2) * size.width;
  const double y0 = Uniform(random, -0.2, 1.2) * size.height;
  const double radius = Uniform(random, 0.02, largest) * std::max(size.width, size.height);
  return Mask::FromPredicate(size,
                             [&](int x, int y) { return std::hypot(x - x0, y - y0) < radius; });
}

// The robot images of a tile: a base that every configuration shows, and an arm.
struct RandomTile {
  RandomTile() = default;
  RandomTile(Random& random, std::vector<MaskSize> sizes, double there) {
    for (const MaskSize size : sizes) trees.emplace_back(size);
    std::vector<std::vector<Mask>> arms(sizes.size());
    std::vector<Mask> bases;
    for (size_t view = 0; view < sizes.size(); ++view) {
      for (int i = 0; i < 40; ++i) arms[view].push_back(RandomDisc(random, sizes[view], 0.15));
      bases.push_back(RandomDisc(random, sizes[view], 0.1));
    }
    for (uint64_t place = 0; place < kTileSize; ++place) {
      if (Uniform(random, 0, 1) >= there) continue;
      std::vector<Mask>& masks = images[place];
      for (size_t view = 0; view < sizes.size(); ++view) {
        const Mask& arm = arms[view][random() % arms[view].size()];
        masks.push_back(random() % 8 == 0 ? arm : bases[view] | arm);
      }
    }
    TileIndexBuilder builder(trees);
    for (const auto& [place, masks] : images) {
      builder.Add(place, std::vector<MaskWords>(Words(masks)));
    }
    bytes = builder.Finish();
  }

  static std::vector<MaskWords> Words(const std::vector<Mask>& masks) {
    std::vector<MaskWords> words;
    for (const Mask& mask : masks) words.push_back(mask.words());
    return words;
  }

  PlaceSet Touching(size_t view, const Mask& plane) const {
    PlaceSet touching;
    for (const auto& [place, masks] : images) {
      if (Intersects(plane.words(), masks[view].words())) touching.Insert(place);
    }
    return touching;
  }

  std::vector<PixelTree> trees;
  std::map<uint64_t, std::vector<Mask>> images;
  std::vector<std::byte> bytes;
};

class TileIndexOfSize : public testing::TestWithParam<MaskSize> {};

TEST_P(TileIndexOfSize, TouchesWhatTheRobotImagesTouchWithEveryInstructionSet) {
  Random random;
  for (const double there : {1.0, 0.3}) {
    const RandomTile tile(random, {GetParam(), {7, 5}}, there);
    const TileIndex index(tile.bytes, tile.trees);
    for (int i = 0; i < 8; ++i) {
      for (size_t view = 0; view < 2; ++view) {
        const MaskSize size = tile.trees[view].size();
        Mask plane = RandomDisc(random, size, 0.3);
        if (i % 2 == 1) plane = plane - RandomDisc(random, size, 0.1);
        const Nodes cover = tile.trees[view].Cover(plane);
        const PlaceSet expected = tile.Touching(view, plane);
        EXPECT_EQ(index.AnyTouches(static_cast<int>(view), cover), !expected.Empty());
        for (const InstructionSet set : InstructionSets()) {
          PlaceSet touching;
          index.AddTouching(static_cast<int>(view), cover, touching, UnionWith(set));
          EXPECT_EQ(touching, expected) << "instruction set " << static_cast<int>(set);
        }
      }
    }
  }
}

TEST_P(TileIndexOfSize, GivesTheRobotImagesBack) {
  Random random;
  const RandomTile tile(random, {{9, 9}, GetParam()}, 0.05);
  const TileIndex index(tile.bytes, tile.trees);
  for (uint64_t place = 0; place < kTileSize; ++place) {
    ASSERT_EQ(index.present().Contains(place), tile.images.contains(place)) << place;
  }
  for (const auto& [place, masks] : tile.images) {
    ASSERT_EQ(index.Image(0, place), masks[0]) << place;
    ASSERT_EQ(index.Image(1, place), masks[1]) << place;
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, TileIndexOfSize,
                         testing::Values(MaskSize{64, 64}, MaskSize{128, 96}, MaskSize{256, 192},
                                         MaskSize{320, 240}, MaskSize{1, 1}, MaskSize{37, 53}),
                         [](const auto& tested) {
                           return std::to_string(tested.param.width) + "x" +
                                  std::to_string(tested.param.height);
                         });

TEST(TileIndex, BuilderBeginsAnewForEveryTile) {
  Random random;
  const RandomTile one(random, {{20, 20}}, 0.5);
  TileIndexBuilder builder(one.trees);
  const std::vector<std::byte> empty = builder.Finish();
  for (int i = 0; i < 2; ++i) {
    for (const auto& [place, masks] : one.images) builder.Add(place, RandomTile::Words(masks));
    EXPECT_EQ(builder.Finish(), one.bytes);
  }
  EXPECT_EQ(builder.Finish(), empty);
  EXPECT_TRUE(TileIndex(empty, one.trees).present().Empty());
}

TEST(TileIndex, NodesThatNoOrEveryConfigurationTouchesTakeNoSet) {
  std::vector<PixelTree> trees;
  trees.emplace_back(MaskSize{64, 64});
  const Mask base = Mask::FromPredicate({64, 64}, [](int x, int y) { return x < 20 && y < 9; });
  TileIndexBuilder builder(trees);
  const size_t empty = builder.Finish().size();
  for (uint64_t place = 0; place < kTileSize; ++place) {
    builder.Add(place, std::vector<MaskWords>{base.words()});
  }
  EXPECT_EQ(builder.Finish().size(), empty);
}

TEST(TileIndex, PlacesOutOfOrderAndImagesOfOtherSizesAreRefused) {
  std::vector<PixelTree> trees;
  trees.emplace_back(MaskSize{16, 16});
  const Mask mask(MaskSize{16, 16}), larger(MaskSize{16, 32});
  TileIndexBuilder builder(trees);
  builder.Add(5, std::vector<MaskWords>{mask.words()});
  EXPECT_THROW(builder.Add(5, std::vector<MaskWords>{mask.words()}), std::invalid_argument);
  EXPECT_THROW(builder.Add(6, std::vector<MaskWords>{larger.words()}), std::invalid_argument);
  EXPECT_THROW(builder.Add(6, std::vector<MaskWords>{}), std::invalid_argument);
  EXPECT_THROW(builder.Add(kTileSize, std::vector<MaskWords>{mask.words()}), std::invalid_argument);
}

// Whatever the bytes are: an index that can be asked without reading beyond them, or a refusal.
TEST(TileIndex, DamagedBytesAreRefusedOrHarmless) {
  Random random;
  const RandomTile tile(random, {{24, 24}, {10, 10}}, 0.1);
  const Mask everything = ~Mask(MaskSize{24, 24});
  const auto ask = [&](const std::vector<std::byte>& bytes) {
    try {
      const TileIndex index(bytes, tile.trees);
      PlaceSet touching;
      index.AddTouching(0, tile.trees[0].Cover(everything), touching);
      index.Image(0, 17);
      return true;
    } catch (const std::invalid_argument&) {
      return false;
    }
  };
  EXPECT_TRUE(ask(tile.bytes));
  for (size_t length = 0; length < tile.bytes.size(); length += 1 + random() % 97) {
    EXPECT_FALSE(ask({tile.bytes.begin(), tile.bytes.begin() + static_cast<ptrdiff_t>(length)}));
  }
  int refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::byte> damaged = tile.bytes;
    damaged[random() % std::min<size_t>(damaged.size(), 4096)] ^= std::byte(1 + random() % 255);
    if (!ask(damaged)) ++refused;
  }
  EXPECT_GT(refused, 0);
  EXPECT_THROW(TileIndex(tile.bytes, std::span(tile.trees).first(1)), std::invalid_argument);
}

// The file under a map can change: answers are wrong then, but nothing beyond the bytes is read.
TEST(TileIndex, BytesThatChangeWhileItIsUsedAreHarmless) {
  Random random;
  RandomTile tile(random, {{24, 24}, {10, 10}}, 0.1);
  const TileIndex index(tile.bytes, tile.trees);
  const PlaceSet present = index.present();
  for (const int value : {0x00, 0xff}) {
    std::ranges::fill(tile.bytes, std::byte(value));
    PlaceSet touching;
    index.AddTouching(0, tile.trees[0].Cover(~Mask(MaskSize{24, 24})), touching);
    index.Image(1, 17);
    EXPECT_EQ(index.present(), present);
  }
}

TEST(PixelTree, CoverIsJustTheMaskWithTheFewestNodes) {
  Random random;
  for (const MaskSize size : {MaskSize{64, 64}, MaskSize{37, 53}, MaskSize{1, 9}}) {
    const PixelTree tree(size);
    for (int i = 0; i < 20; ++i) {
      const Mask mask = RandomDisc(random, size, 0.5);
      std::vector<bool> taken(tree.nodes(), false);
      uint32_t before = 0;
      for (const NodeWord& word : tree.Cover(mask)) {
        EXPECT_NE(word.bits, 0u);
        EXPECT_TRUE(before == 0 || word.word > before);
        before = word.word;
        for (size_t bit = 0; bit < 64; ++bit) {
          if ((word.bits >> bit & 1) != 0) taken[size_t{64} * word.word + bit] = true;
        }
      }
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
          int covering = 0;
          for (int level = 0; level < tree.levels(); ++level) {
            if (taken[tree.NodeOf(level, x >> level, y >> level)]) ++covering;
          }
          ASSERT_EQ(covering, mask.at(x, y) ? 1 : 0) << x << ", " << y;
        }
      }
      // No four nodes that one could stand for.
      for (int level = 1; level < tree.levels(); ++level) {
        const MaskSize below = tree.level_size(level - 1);
        const MaskSize here = tree.level_size(level);
        for (int y = 0; y < here.height; ++y) {
          for (int x = 0; x < here.width; ++x) {
            bool all = true;
            for (int j = 2 * y; j < std::min(2 * y + 2, below.height); ++j) {
              for (int k = 2 * x; k < std::min(2 * x + 2, below.width); ++k) {
                all = all && taken[tree.NodeOf(level - 1, k, j)];
              }
            }
            EXPECT_FALSE(all) << "level " << level;
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace silhouette
