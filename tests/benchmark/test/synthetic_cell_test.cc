// SPDX-License-Identifier: Apache-2.0
// The renderer against the definition of its masks, pixel by pixel, and the cells made with it.
#include "tests/benchmark/synthetic_cell.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/benchmark/scenes.h"
#include "tests/random.h"

namespace silhouette::benchmarks {
namespace {

// Distance of a pixel's square from the hull of two discs: the hull is the union of the discs
// between them; how far such a disc is from the square is a convex function of its place.
double DistanceOfSquare(int x, int y, const Disc& a, const Disc& b) {
  const auto distance = [&](double t) {
    const double dx = a.x + t * (b.x - a.x);
    const double dy = a.y + t * (b.y - a.y);
    const double off_x = std::max({0.0, x - dx, dx - (x + 1)});
    const double off_y = std::max({0.0, y - dy, dy - (y + 1)});
    return std::hypot(off_x, off_y) - (a.radius + t * (b.radius - a.radius));
  };
  double low = 0;
  double high = 1;
  for (int i = 0; i < 100; ++i) {
    const double third = (high - low) / 3;
    if (distance(low + third) < distance(high - third)) {
      high -= third;
    } else {
      low += third;
    }
  }
  return distance((low + high) / 2);
}

TEST(DrawHull, SetsThePixelsThatTheHullTouches) {
  Random random;
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  for (int round = 0; round < 300; ++round) {
    const MaskSize size{1 + static_cast<int>(random() % 90), 1 + static_cast<int>(random() % 40)};
    const auto disc = [&] {
      return Disc{number(-20, size.width + 20), number(-20, size.height + 20), number(0.05, 12)};
    };
    const Disc a = disc();
    Disc b = disc();
    if (round % 3 == 0) b = {a.x + number(-2, 2), a.y + number(-2, 2), b.radius};
    std::vector<uint64_t> words(size.words());
    DrawHull(a, b, size, words);
    const Mask mask = Mask::FromWords(size, words);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const double distance = DistanceOfSquare(x, y, a, b);
        if (std::abs(distance) < 1e-6) continue;  // either is right
        ASSERT_EQ(mask.at(x, y), distance < 0)
            << "pixel " << x << ", " << y << " of discs " << a.x << " " << a.y << " " << a.radius
            << " and " << b.x << " " << b.y << " " << b.radius;
      }
    }
  }
}

TEST(DrawHull, DrawsLevelAndUprightCapsules) {
  for (const auto& [bx, by] : {std::pair(20.5, 6.5), std::pair(6.5, 20.5)}) {
    std::vector<uint64_t> words(MaskSize{32, 32}.words());
    DrawHull({6.5, 6.5, 2}, {bx, by, 2}, {32, 32}, words);
    const Mask mask = Mask::FromWords({32, 32}, words);
    EXPECT_EQ(mask.Count(), 5u * 15u + 2u * 8u);  // the straight part, and half a disc at each end
    EXPECT_TRUE(mask.at(static_cast<int>(bx), static_cast<int>(by)));
  }
}

TEST(PinholeView, SeesPointsWhereTheirRaysGo) {
  const PinholeView view({3, 2, 1.5}, {0, 0, 0.5}, 0.4, {64, 48});
  const Disc target = view.See({0, 0, 0.5}, 0.1);
  EXPECT_NEAR(target.x, 32, 1e-9);
  EXPECT_NEAR(target.y, 24, 1e-9);
  const Disc higher = view.See({0, 0, 0.8}, 0.1);
  EXPECT_LT(higher.y, target.y);
  const Eigen::Vector3d on_ray = view.centre() + 2 * view.Ray(10.25, 40.5);
  EXPECT_NEAR(view.See(on_ray, 0.1).x, 10.25, 1e-9);
  EXPECT_NEAR(view.See(on_ray, 0.1).y, 40.5, 1e-9);
}

TEST(SyntheticCell, ReachesTheFillAsked) {
  for (const double fill : {0.02, 0.10}) {
    for (const MaskSize size : {MaskSize{64, 64}, MaskSize{128, 96}}) {
      const SyntheticCell cell({.steps = {8, 8, 8}, .mask_size = size, .fill = fill});
      EXPECT_NEAR(cell.fill(), fill, 0.02 * fill);
    }
  }
  EXPECT_THROW(SyntheticCell({.steps = {8, 8}, .fill = 0.99}), std::invalid_argument);
  EXPECT_THROW(SyntheticCell({.steps = {8, 8, 8, 8, 8}}), std::invalid_argument);
}

TEST(SyntheticCell, GivesTheSameImagesByTheTileAndSingly) {
  const SyntheticCell cell({.steps = {5, 6, 7, 9, 5, 3}});
  const RobotImageTable table = cell.Table();
  EXPECT_EQ(table.Count(RobotImageState::kPresent), cell.grid().size());
  uint64_t next = 0;
  cell.ForEachTile([&](const TileMasks& tile) {
    EXPECT_EQ(tile.tile(), next++);
    for (uint64_t place = 0; place < kTileSize; place += 7) {
      const ConfigurationNumber number = tile.tile() * kTileSize + place;
      ASSERT_EQ(tile.present(place), cell.grid().Contains(number));
      for (int view = 0; view < kViews; ++view) {
        const MaskWords words = tile.mask(view, place);
        const Mask drawn = Mask::FromWords(cell.mask_size(), {words.begin(), words.end()});
        if (!tile.present(place)) {
          EXPECT_TRUE(drawn.Empty());
          continue;
        }
        EXPECT_EQ(drawn, cell.RobotImage(view, cell.grid().At(number)));
        EXPECT_EQ(drawn, (*table.Images(number))[view]);
      }
    }
  });
  EXPECT_EQ(next, cell.grid().tiles());
}

TEST(SyntheticCell, HasGridsOfTheSizesTheyAreCalledBy) {
  const auto size = [](const std::vector<int>& steps) {
    return SyntheticCell({.steps = steps}).grid().size();
  };
  EXPECT_EQ(size(StepsOfSize3k()), 3072u);
  EXPECT_EQ(size(StepsOfSize1M()), 983040u);
  EXPECT_NEAR(static_cast<double>(size(StepsOfSize10M())), 10e6, 0.4e6);
  EXPECT_NEAR(static_cast<double>(size(StepsOfSize10MWithSixJoints())), 10e6, 0.4e6);
}

TEST(Scenes, AreSeenByEveryViewAndDifferByKindAndSeed) {
  const SyntheticCell cell({.steps = StepsOfSize1M()});
  for (const SceneKind kind : kSceneKinds) {
    SCOPED_TRACE(NameOf(kind));
    const std::vector<BenchmarkScene> scenes = MakeScenes(cell, kind, 3);
    for (const BenchmarkScene& scene : scenes) {
      for (const auto& image : scene.images) EXPECT_FALSE(image->Background().Empty());
    }
    EXPECT_NE(scenes[0].images[0]->obstacle(), scenes[1].images[0]->obstacle());
    EXPECT_EQ(scenes[1].images[2]->obstacle(), MakeScene(cell, kind, 2).images[2]->obstacle());
  }
  const auto pixels = [&](SceneKind kind) {
    return MakeScene(cell, kind, 1).images[0]->obstacle().Count();
  };
  EXPECT_LT(pixels(SceneKind::kHand), pixels(SceneKind::kPerson));
  EXPECT_LT(pixels(SceneKind::kPerson), pixels(SceneKind::kClutter));
}

}  // namespace
}  // namespace silhouette::benchmarks
