// SPDX-License-Identifier: Apache-2.0
#include "server/collision/collision_checker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "tests/random.h"
#include "tests/server/collision/random_cell.h"

namespace silhouette {
namespace {

ConfigurationGrid CollisionSmallGrid() {
  return ConfigurationGrid(
      {{.name = "a", .lower = -1, .upper = 1, .steps = 5},
       {.name = "b", .lower = 0, .upper = 6.283185307179586, .steps = 6, .continuous = true}});
}

// All policies of n views.
std::vector<Policy> AllPolicies(int views) {
  std::vector<Policy> policies = {{.preset = Preset::kPaper}};
  for (int occluded = 0; occluded <= views; ++occluded) {
    policies.push_back({.max_occluded_views = occluded});
  }
  for (int min_views = 1; min_views <= views; ++min_views) {
    policies.push_back({.min_views = min_views});
  }
  return policies;
}

struct Seeded : ::testing::Test {
  Random random;
};

using CollisionTestAgainstReference = Seeded;
using OffGridTest = Seeded;
using TileTest = Seeded;
using MissingViewTest = Seeded;

// The uncalibrated test pixel by pixel, straight from Tables 1 and 2.
Verdict CollisionReference(const std::vector<Mask>& scene, const std::vector<Mask>& robot,
                           const std::vector<Mask>& test_robot, int min_views,
                           std::vector<ViewEvidence>& evidence) {
  int showing = 0;
  int hiding = 0;
  for (size_t v = 0; v < scene.size(); ++v) {
    ViewEvidence& counts = evidence[v] = {};
    for (int x = 0; x < scene[v].width(); ++x) {
      for (int y = 0; y < scene[v].height(); ++y) {
        if (!test_robot[v].at(x, y)) continue;
        if (scene[v].at(x, y))
          ++(robot[v].at(x, y) ? counts.unknown_pixels : counts.obstacle_pixels);
        if (!scene[v].at(x, y) && robot[v].at(x, y)) ++counts.error_pixels;
      }
    }
    if (counts.obstacle_pixels > 0) ++showing;
    if (counts.obstacle_pixels == 0 && counts.unknown_pixels + counts.error_pixels > 0) ++hiding;
  }
  const bool hidden = hiding == static_cast<int>(scene.size());
  return showing >= min_views ? Verdict::Occupied(hidden) : Verdict::Free(hidden);
}

TEST_F(CollisionTestAgainstReference, AgreesOnRandomMasksForEveryPolicy) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 0, .steps = 1}});
  std::array<int, 3> seen{};
  int hidden_seen = 0;
  for (int round = 0; round < 300; ++round) {
    const int views = 1 + round % 5;
    const std::vector<MaskSize> sizes = RandomSizes(views, random);
    std::vector<Mask> scene, robot, test_robot;
    ObstacleImages obstacle_images;
    for (MaskSize size : sizes) {
      scene.push_back(RandomMask(size, round % 3 == 0 ? 0.3 : 0.02, random));
      robot.push_back(RandomMask(size, 0.3, random));
      test_robot.push_back(RandomMask(size, 0.1, random));
      obstacle_images.push_back(ObstacleImage::FromScene(scene.back(), robot.back()));
    }
    RobotImageTable::Builder builder(grid, sizes);
    builder.Add(0, test_robot);
    const RobotImageTable table = std::move(builder).Build();
    for (const Policy& policy : AllPolicies(views)) {
      const CollisionChecker test(table, obstacle_images, policy);
      std::vector<ViewEvidence> expected_evidence(views), evidence(views);
      const Verdict expected =
          CollisionReference(scene, robot, test_robot, MinViews(policy, views), expected_evidence);
      EXPECT_EQ(test.Check(ConfigurationNumber{0}, evidence), expected);
      EXPECT_EQ(evidence, expected_evidence);
      EXPECT_EQ(test.Check(ConfigurationNumber{0}), expected) << "without evidence";
      ++seen[static_cast<int>(expected.state())];
      hidden_seen += expected.hidden_possible();
    }
  }
  EXPECT_GT(seen[static_cast<int>(State::kFree)], 0);
  EXPECT_GT(seen[static_cast<int>(State::kOccupied)], 0);
  EXPECT_GT(hidden_seen, 0);
}

TEST_F(CollisionTestAgainstReference, ViewsShowWhatTheirCollisionImagesShow) {
  const ConfigurationGrid grid = CollisionSmallGrid();
  const std::vector<MaskSize> sizes = RandomSizes(1, random);
  const RobotImageTable table = RandomTable(grid, sizes, 0.05, random);
  const ObstacleImages images = RandomObstacleImages(sizes, 0.3, random);
  const CollisionChecker test(table, images, {});
  for (int a = 0; a < 5; ++a) {
    const ConfigurationNumber number = grid.NumberOf({a, 2});
    const bool shown = !(images[0]->obstacle() & (*table.Images(number))[0]).Empty();
    EXPECT_EQ(test.Check(number).state(), shown ? State::kOccupied : State::kFree);
  }
}

TEST_F(OffGridTest, CellIsTheUnionOfTheCornersPerView) {
  const ConfigurationGrid grid = CollisionSmallGrid();
  const std::vector<MaskSize> sizes = RandomSizes(3, random);
  const RobotImageTable table = RandomTable(grid, sizes, 0.03, random);
  const ObstacleImages images = RandomObstacleImages(sizes, 0.3, random);
  std::uniform_real_distribution<double> a(-1, 1), b(-7, 14);
  for (int round = 0; round < 200; ++round) {
    Configuration q = {a(random), b(random)};
    if (round % 4 == 0) q = grid.At({round / 4 % 5, round % 6});
    const CellCorners corners = grid.CornersAround(q);
    ASSERT_GT(corners.count(), 0);
    for (const Policy& policy : AllPolicies(3)) {
      const CollisionChecker test(table, images, policy);
      int showing = 0;
      std::vector<ViewEvidence> evidence(3);
      const Verdict verdict = test.Check(q, evidence);
      for (int view = 0; view < 3; ++view) {
        Mask robot(sizes[view]);
        bool hit_at_a_corner = false;
        for (ConfigurationNumber corner : corners.numbers()) {
          robot = robot | (*table.Images(corner))[view];
          hit_at_a_corner = hit_at_a_corner ||
                            Intersects(table.image(view, corner), images[view]->obstacle().words());
        }
        showing += hit_at_a_corner;
        EXPECT_EQ((*test.TestRobotImages(q))[static_cast<size_t>(view)], robot);
        EXPECT_EQ(evidence[view].obstacle_pixels, (images[view]->obstacle() & robot).Count());
        EXPECT_EQ(evidence[view].unknown_pixels, (images[view]->unknown() & robot).Count());
        EXPECT_EQ(evidence[view].error_pixels, (images[view]->error() & robot).Count());
      }
      EXPECT_EQ(verdict.state(), showing >= MinViews(policy, 3) ? State::kOccupied : State::kFree);
    }
  }
}

TEST_F(OffGridTest, NearestIsTheNearestGridPoint) {
  const ConfigurationGrid grid = CollisionSmallGrid();
  const std::vector<MaskSize> sizes = RandomSizes(2, random);
  const RobotImageTable table = RandomTable(grid, sizes, 0.05, random);
  const ObstacleImages images = RandomObstacleImages(sizes, 0.3, random);
  const CollisionChecker test(table, images, {.off_grid = OffGrid::kNearest});
  std::uniform_real_distribution<double> a(-1, 1), b(-7, 14);
  for (int round = 0; round < 200; ++round) {
    const Configuration q = {a(random), b(random)};
    EXPECT_EQ(test.Check(q), test.Check(*grid.Nearest(q)));
    EXPECT_EQ((*test.TestRobotImages(q))[1], (*table.Images(*grid.Nearest(q)))[1]);
  }
}

TEST(CollisionChecker, ConfigurationOutsideTheGridIsNeverFree) {
  const ConfigurationGrid grid = CollisionSmallGrid();
  const std::vector<MaskSize> sizes = {{4, 4}};
  std::mt19937_64 random(1);
  const RobotImageTable table = RandomTable(grid, sizes, 0.5, random);
  const ObstacleImages images = {ObstacleImage::FromScene(Mask(sizes[0]), Mask(sizes[0]))};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (OffGrid off_grid : {OffGrid::kCell, OffGrid::kNearest}) {
    const CollisionChecker test(table, images, {.off_grid = off_grid});
    ASSERT_TRUE(test.Check(Configuration{0, 0}).free());
    for (const Configuration& q : std::vector<Configuration>{
             {1.01, 0}, {-1.01, 0}, {nan, 0}, {0, nan}, {0}, {0, 0, 0}, {}}) {
      EXPECT_EQ(test.Check(q), Verdict::Unknown(Reason::kOutsideGrid));
      EXPECT_EQ(test.TestRobotImages(q), std::nullopt);
    }
    EXPECT_EQ(test.Check(grid.number_limit()), Verdict::Unknown(Reason::kOutsideGrid));
    EXPECT_EQ(test.Check(kTileSize - 1), Verdict::Unknown(Reason::kOutsideGrid)) << "absent place";
  }
}

TEST(CollisionChecker, CellWithAnUnusableCornerIsNeverFree) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 4, .steps = 5}});
  const std::vector<Mask> masks = {Mask({4, 4})};
  RobotImageTable::Builder builder(grid, {{4, 4}});
  builder.Add(grid.NumberOf({0}), masks);
  builder.AddWithout(grid.NumberOf({1}), RobotImageState::kExcluded);
  builder.AddWithout(grid.NumberOf({2}), RobotImageState::kCorrupt);
  builder.Add(grid.NumberOf({4}), masks);
  const RobotImageTable table = std::move(builder).Build();
  const ObstacleImages images = {ObstacleImage::FromScene(masks[0], masks[0])};
  const CollisionChecker test(table, images, {});
  EXPECT_TRUE(test.Check(Configuration{0}).free());
  EXPECT_EQ(test.Check(Configuration{0.5}).reason(), Reason::kExcluded);
  EXPECT_EQ(test.Check(Configuration{1}).reason(), Reason::kExcluded);
  EXPECT_EQ(test.Check(Configuration{1.5}).reason(), Reason::kExcluded);
  EXPECT_EQ(test.Check(Configuration{2}).reason(), Reason::kRobotImageCorrupt);
  EXPECT_EQ(test.Check(Configuration{2.5}).reason(), Reason::kRobotImageCorrupt);
  EXPECT_EQ(test.Check(Configuration{3}).reason(), Reason::kRobotImageMissing);
  EXPECT_EQ(test.Check(Configuration{3.5}).reason(), Reason::kRobotImageMissing);
  EXPECT_TRUE(test.Check(Configuration{4}).free());
  const TileVerdicts tile = test.CheckTile(0);
  EXPECT_EQ(tile.free[0], (1u << grid.NumberOf({0})) | (1u << grid.NumberOf({4})));
  EXPECT_EQ(tile.occupied[0], 0u);
}

TEST_F(MissingViewTest, CountsAsShowingAnObstacleAndIsNeverFree) {
  const ConfigurationGrid grid = CollisionSmallGrid();
  const int views = 3;
  std::array<int, 3> seen{};
  for (int round = 0; round < 20; ++round) {
    const std::vector<MaskSize> sizes = RandomSizes(views, random);
    const RobotImageTable table = RandomTable(grid, sizes, 0.05, random);
    const ObstacleImages whole = RandomObstacleImages(sizes, 0.2, random);
    for (int lost = 1; lost < 1 << views; ++lost) {
      ObstacleImages images = whole;
      int missing = 0;
      for (int view = 0; view < views; ++view) {
        if ((lost >> view) & 1) images[view].reset(), ++missing;
      }
      for (const Policy& policy : AllPolicies(views)) {
        const CollisionChecker before(table, whole, policy);
        const CollisionChecker after(table, images, policy);
        for (int b = 0; b < 6; ++b) {
          const ConfigurationNumber number = grid.NumberOf({round % 5, b});
          std::vector<ViewEvidence> evidence(views);
          const Verdict verdict = after.Check(number, evidence);
          EXPECT_FALSE(verdict.free());
          if (before.Check(number).state() == State::kOccupied) {
            EXPECT_EQ(verdict.state(), State::kOccupied) << "losing a view lost an obstacle";
          }
          int showing = missing;
          for (int view = 0; view < views; ++view) {
            EXPECT_EQ(evidence[view].missing, !images[view]);
            showing += evidence[view].obstacle_pixels > 0;
          }
          EXPECT_EQ(verdict.state() == State::kOccupied, showing >= MinViews(policy, views));
          if (verdict.state() == State::kUnknown) {
            EXPECT_EQ(verdict.reason(), Reason::kViewMissing);
          }
          ++seen[static_cast<int>(verdict.state())];
        }
        const TileVerdicts tile = after.CheckTile(0);
        EXPECT_TRUE(std::ranges::all_of(tile.free, [](uint64_t word) { return word == 0; }));
        for (int b = 0; b < 6; ++b) {
          const uint64_t place = grid.NumberOf({round % 5, b});
          EXPECT_EQ((tile.occupied[place / 64] >> (place % 64)) & 1,
                    after.Check(place).state() == State::kOccupied);
        }
      }
    }
  }
  EXPECT_GT(seen[static_cast<int>(State::kUnknown)], 0);
  EXPECT_GT(seen[static_cast<int>(State::kOccupied)], 0);
}

TEST(CollisionChecker, ObstacleThatMayHideInAllViewsIsTold) {
  const MaskSize size{2, 1};
  const Mask robot = Mask::FromPredicate(size, [](int x, int) { return x == 0; });
  const Mask all = ~Mask(size);
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 0, .steps = 1}});
  RobotImageTable::Builder builder(grid, {size, size});
  builder.Add(0, std::vector<Mask>{all, all});
  const RobotImageTable table = std::move(builder).Build();
  const ObstacleImage unknown = ObstacleImage::FromScene(robot, robot);
  const ObstacleImage error = ObstacleImage::FromScene(Mask(size), robot);
  const ObstacleImage nothing = ObstacleImage::FromScene(Mask(size), Mask(size));
  const ObstacleImage obstacle = ObstacleImage::FromScene(all, robot);
  const auto check = [&](std::optional<ObstacleImage> a, std::optional<ObstacleImage> b) {
    const ObstacleImages images = {a, b};
    return CollisionChecker(table, images, {.preset = Preset::kPaper})
        .Check(ConfigurationNumber{0});
  };
  EXPECT_EQ(check(unknown, unknown), Verdict::Free(true));
  EXPECT_EQ(check(unknown, error), Verdict::Free(true));
  EXPECT_EQ(check(unknown, nothing), Verdict::Free(false));
  EXPECT_EQ(check(unknown, obstacle), Verdict::Free(false));
  EXPECT_EQ(check(obstacle, obstacle), Verdict::Occupied(false));
  EXPECT_EQ(check(unknown, std::nullopt), Verdict::Unknown(Reason::kViewMissing, true));
  EXPECT_EQ(check(nothing, std::nullopt), Verdict::Unknown(Reason::kViewMissing, false));
}

TEST_F(TileTest, WholeSpaceEqualsSingleChecks) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 90},
                                {.name = "b", .lower = 0, .upper = 1, .steps = 70}});
  ASSERT_GT(grid.tiles(), 1u);
  const std::vector<MaskSize> sizes = RandomSizes(4, random);
  RobotImageTable::Builder builder(grid, sizes);
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number) || number % 11 == 0) continue;
    std::vector<Mask> masks;
    for (MaskSize size : sizes) masks.push_back(RandomBox(size, random));
    number % 13 == 0 ? builder.AddWithout(number, RobotImageState::kExcluded)
                     : builder.Add(number, masks);
  }
  const RobotImageTable table = std::move(builder).Build();
  const ObstacleImages images = RandomObstacleImages(sizes, 0.1, random);
  for (const Policy& policy : AllPolicies(4)) {
    const CollisionChecker test(table, images, policy);
    for (uint64_t tile = 0; tile < grid.tiles(); ++tile) {
      const TileVerdicts verdicts = test.CheckTile(tile);
      for (uint64_t place = 0; place < kTileSize; ++place) {
        const State state = test.Check(tile * kTileSize + place).state();
        const bool free = (verdicts.free[place / 64] >> (place % 64)) & 1;
        const bool occupied = (verdicts.occupied[place / 64] >> (place % 64)) & 1;
        ASSERT_EQ(free, state == State::kFree) << tile << " " << place;
        ASSERT_EQ(occupied, state == State::kOccupied) << tile << " " << place;
      }
    }
  }
}

TEST(CollisionChecker, WhatDoesNotFitTheTableIsRefused) {
  std::mt19937_64 random(1);
  const ConfigurationGrid grid = CollisionSmallGrid();
  const RobotImageTable table = RandomTable(grid, {{4, 4}, {5, 5}}, 0.5, random);
  EXPECT_THROW(CollisionChecker(table, {}, {}), std::invalid_argument);
  const ObstacleImages turned = RandomObstacleImages({{5, 5}, {4, 4}}, 0.5, random);
  EXPECT_THROW(CollisionChecker(table, turned, {}), std::invalid_argument);
  const ObstacleImages images = RandomObstacleImages({{4, 4}, {5, 5}}, 0.5, random);
  EXPECT_THROW(CollisionChecker(table, images, {.min_views = 3}), std::invalid_argument);
  std::vector<ViewEvidence> evidence(1);
  EXPECT_THROW(CollisionChecker(table, images, {}).Check(ConfigurationNumber{0}, evidence),
               std::invalid_argument);
}

TEST(Verdict, IsUnknownUntilSomebodyDecidesIt) {
  EXPECT_EQ(State{}, State::kUnknown);
  EXPECT_EQ(Verdict().state(), State::kUnknown);
  EXPECT_EQ(Verdict().reason(), Reason::kInternal);
  EXPECT_FALSE(Verdict().free());
  EXPECT_THROW(Verdict::Unknown(Reason::kNone), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
