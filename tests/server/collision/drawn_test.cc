// SPDX-License-Identifier: Apache-2.0
// Robots whose images are drawn: verdicts at any configuration and on motions, against the truth.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "server/collision/clearance.h"
#include "server/collision/collision_checker.h"
#include "server/collision/space_checker.h"
#include "tests/random.h"
#include "tests/server/collision/drawn_arm.h"

namespace silhouette {
namespace {

class DrawnTest : public ::testing::Test {
 protected:
  TestSupport Prepared(const ObstacleImages& images) {
    prepared_.emplace(arm_.robot(), ObstaclePlanes(images));
    return {.bands = &bands_, .drawn = &*prepared_};
  }

  bool Touches(const Configuration& q, const std::vector<ArmBall>& balls) const {
    return std::ranges::any_of(balls, [&](const ArmBall& b) { return arm_.Touches(q, b); });
  }

  static constexpr Preset kPresets[] = {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated,
                                        Preset::kPaperCalibrated};

  Random random_;
  const DrawnArm arm_;
  const RobotImageTable table_ = arm_.Table();
  const EpipolarBands bands_{Calibration{.cameras = arm_.cameras(), .fundamental_matrices = {}},
                             arm_.sizes()};
  std::optional<DrawnChecker> prepared_;
};

TEST_F(DrawnTest, WhereTheRobotTouchesAnObstacleThatAllViewsSeeIsNeverFree) {
  size_t touching = 0;
  size_t free = 0;
  size_t occupied = 0;
  for (int scene = 0; scene < 30; ++scene) {
    const auto [balls, images] = arm_.SomeScene(random_, 1 + scene % 3);
    for (const Preset preset : kPresets) {
      const CollisionChecker test(table_, images, {.preset = preset}, Prepared(images));
      for (int i = 0; i < 150; ++i) {
        const Configuration q = DrawnArm::Any(random_);
        std::vector<ViewEvidence> evidence(4);
        const Verdict verdict = test.Check(q);
        ASSERT_EQ(verdict, test.Check(q, evidence)) << NameOf(preset);
        const bool touches = Touches(q, balls);
        ASSERT_FALSE(touches && verdict.free()) << NameOf(preset);
        ASSERT_NE(verdict.state(), State::kUnknown);
        touching += touches ? 1 : 0;
        free += verdict.free() ? 1 : 0;
        occupied += !touches && !verdict.free() ? 1 : 0;
      }
    }
  }
  RecordProperty("false_occupied_for_1000_free", static_cast<int>(1000 * occupied / free));
  EXPECT_GT(touching, 100u);
  EXPECT_GT(free, 2000u);
}

TEST_F(DrawnTest, PreparedPlanesDecideAsTheDrawnImagesDo) {
  size_t hidden = 0;
  for (int scene = 0; scene < 20; ++scene) {
    auto [balls, images] = arm_.SomeScene(random_, 1 + scene % 3);
    if (scene % 5 == 4) images[0].reset();
    if (scene % 5 == 3) {  // the base shows no unknown pixel in one view
      images[1] = ObstacleImage::FromScene(images[1]->obstacle(), Mask(images[1]->size()));
    }
    for (int min_views = 1; min_views <= 4; ++min_views) {
      const Policy policy{.min_views = min_views};
      const CollisionChecker fast(table_, images, policy, Prepared(images));
      const CollisionChecker slow(table_, images, policy);
      for (int i = 0; i < 40; ++i) {
        const Configuration q = DrawnArm::Any(random_);
        ASSERT_EQ(fast.Check(q), slow.Check(q)) << min_views << " views, scene " << scene;
        hidden += fast.Check(q).hidden_possible() ? 1 : 0;
      }
    }
  }
  EXPECT_GT(hidden, 0u);
}

TEST_F(DrawnTest, OffTheGridItIsExactAndOccupiesLessThanTheCornersOfACell) {
  RobotImageTable::Builder builder(DrawnArm::Grid(), arm_.sizes());
  const ConfigurationGrid grid = DrawnArm::Grid();
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (grid.Contains(number)) builder.Add(number, arm_.robot()->Touched(grid.At(number)));
  }
  const RobotImageTable captured = std::move(builder).Build();
  size_t drawn_occupied = 0;
  size_t captured_occupied = 0;
  for (int scene = 0; scene < 10; ++scene) {
    const auto [balls, images] = arm_.SomeScene(random_, 2);
    const CollisionChecker drawn(table_, images, {});
    const CollisionChecker by_cell(captured, images, {});
    for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
      ASSERT_EQ(drawn.Check(number), by_cell.Check(number));
    }
    for (int i = 0; i < 100; ++i) {
      const Configuration q = DrawnArm::Any(random_);
      drawn_occupied += drawn.Check(q).free() ? 0 : 1;
      captured_occupied += by_cell.Check(q).free() ? 0 : 1;
      ASSERT_EQ(drawn.TestRobotImages(q), arm_.robot()->Touched(q));
    }
  }
  EXPECT_LT(2 * drawn_occupied, captured_occupied);
}

TEST_F(DrawnTest, WhatIsOutsideTheLimitsIsNeverFree) {
  const auto [balls, images] = arm_.SomeScene(random_, 0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  const RobotImageTable narrow = RobotImageTable::Drawn(
      ConfigurationGrid({{.name = "turn", .lower = 0, .upper = 1, .steps = 2},
                         {.name = "lift", .lower = 0, .upper = 1, .steps = 2},
                         {.name = "reach"}}),
      arm_.robot());
  for (const Preset preset : kPresets) {
    const CollisionChecker test(table_, images, {.preset = preset}, Prepared(images));
    EXPECT_TRUE(test.Check(Configuration{0, 0, 0}).free());
    EXPECT_TRUE(test.Check(Configuration{100, 2, 0.2}).free()) << "it turns without end";
    for (const Configuration& q : std::vector<Configuration>{{0, 2.001, 0},
                                                             {0, -2.001, 0},
                                                             {0, 0, 0.201},
                                                             {nan, 0, 0},
                                                             {0, nan, 0},
                                                             {infinite, 0, 0},
                                                             {0, 0},
                                                             {0, 0, 0, 0},
                                                             {}}) {
      EXPECT_EQ(test.Check(q), Verdict::Unknown(Reason::kOutsideGrid));
      EXPECT_EQ(test.TestRobotImages(q), std::nullopt);
      const PathVerdict path = test.CheckPath(std::vector<Configuration>{{0, 0, 0}, q});
      EXPECT_EQ(path.verdict, Verdict::Unknown(Reason::kOutsideGrid));
      EXPECT_EQ(path.segment, 1);
    }
    EXPECT_EQ(test.Check(~ConfigurationNumber{0}), Verdict::Unknown(Reason::kOutsideGrid));
    const CollisionChecker within(narrow, images, {.preset = preset}, Prepared(images));
    EXPECT_TRUE(within.Check(Configuration{0.5, 0.5, 0}).free());
    EXPECT_EQ(within.Check(Configuration{-0.1, 0.5, 0}), Verdict::Unknown(Reason::kOutsideGrid));
    EXPECT_EQ(within.Check(Configuration{0.5, 0.5, 0.1}), Verdict::Unknown(Reason::kOutsideGrid));
  }
}

TEST_F(DrawnTest, MissingViewIsNeverFree) {
  auto [balls, images] = arm_.SomeScene(random_, 2);
  images[2].reset();
  for (const Preset preset : kPresets) {
    const CollisionChecker test(table_, images, {.preset = preset}, Prepared(images));
    for (int i = 0; i < 200; ++i) {
      const Configuration q = DrawnArm::Any(random_);
      ASSERT_FALSE(test.Check(q).free());
      if (i < 20) {
        ASSERT_FALSE(test.CheckPath(std::vector{q, DrawnArm::Any(random_)}).verdict.free());
      }
    }
  }
}

TEST_F(DrawnTest, ForbiddenIsNeverFreeNorIsAMotionAcrossIt) {
  const auto [balls, images] = arm_.SomeScene(random_, 0);
  const RobotImageTable table =
      arm_.Table(6, JointRegions({{{.joint = 1, .lower = 0.5, .upper = 0.51}}}));
  for (const Preset preset : kPresets) {
    const CollisionChecker test(table, images, {.preset = preset}, Prepared(images));
    EXPECT_EQ(test.Check(Configuration{0, 0.505, 0}), Verdict::Unknown(Reason::kExcluded));
    EXPECT_TRUE(test.Check(Configuration{0, 0.4, 0}).free());
    const PathVerdict path =
        test.CheckPath(std::vector<Configuration>{{0, 0, 0}, {0, 1, 0}}, {}, {.resolution = 0.1});
    EXPECT_EQ(path.verdict, Verdict::Unknown(Reason::kExcluded));
    EXPECT_NEAR(path.fraction, 0.5, 0.1);
  }
  const ConfigurationNumber number = table.grid().Nearest(Configuration{0, 0.4, 0}).value();
  EXPECT_EQ(table.state(number), RobotImageState::kPresent);
  const RobotImageTable all =
      arm_.Table(6, JointRegions({{{.joint = 1, .lower = -2, .upper = 2}}}));
  EXPECT_EQ(all.state(number), RobotImageState::kExcluded);
  EXPECT_EQ(CollisionChecker(all, images, {}).CheckTile(0), TileVerdicts());
}

TEST_F(DrawnTest, NoFreeMotionTouchesAnObstacle) {
  size_t free = 0;
  size_t proven = 0;
  size_t occupied = 0;
  for (int scene = 0; scene < 12; ++scene) {
    const auto [balls, images] = arm_.SomeScene(random_, 2);
    for (const Preset preset : kPresets) {
      const CollisionChecker test(table_, images, {.preset = preset}, Prepared(images));
      for (int i = 0; i < 12; ++i) {
        const std::vector<Configuration> path = {DrawnArm::Any(random_), DrawnArm::Any(random_)};
        const PathVerdict verdict = test.CheckPath(path);
        if (!verdict.verdict.free()) {
          ++occupied;
          ASSERT_FALSE(test.Check(verdict.configuration).free());
          for (size_t j = 0; j < 3 && verdict.segment == 0; ++j) {
            ASSERT_NEAR(verdict.configuration[j],
                        path[0][j] + verdict.fraction * (path[1][j] - path[0][j]), 1e-9);
          }
          continue;
        }
        ++free;
        proven += verdict.sampled_step == 0 ? 1 : 0;
        ASSERT_LE(verdict.sampled_step, kMotionResolution / 2 * (1 + 1e-9));
        for (int step = 0; step <= 1000; ++step) {
          Configuration q = path[0];
          for (size_t j = 0; j < 3; ++j) q[j] += step / 1000.0 * (path[1][j] - path[0][j]);
          const bool touches = Touches(q, balls);
          ASSERT_FALSE(touches && verdict.sampled_step == 0) << NameOf(preset);
          ASSERT_FALSE(touches && !test.Check(q).free()) << NameOf(preset);
        }
      }
    }
  }
  EXPECT_GT(free, 50u);
  EXPECT_GT(proven, 10u);
  EXPECT_GT(occupied, 50u);
}

TEST_F(DrawnTest, AWallBetweenTwoFreeEndsIsFoundWhereItIs) {
  const std::vector<ArmBall> balls = {{{0.6, 0, 0.8}, 0.05}};
  const auto images = arm_.See(balls, {2, 0, 0});
  ASSERT_TRUE(images);
  const std::vector<Configuration> path = {{-1.5, 0, 0}, {1.5, 0, 0}};
  for (const Preset preset : {Preset::kUncalibrated, Preset::kPaper}) {
    const CollisionChecker test(table_, *images, {.preset = preset}, Prepared(*images));
    EXPECT_TRUE(test.Check(path[0]).free());
    EXPECT_TRUE(test.Check(path[1]).free());
    std::vector<ViewEvidence> evidence(4);
    const PathVerdict verdict = test.CheckPath(path, evidence);
    EXPECT_EQ(verdict.verdict.state(), State::kOccupied);
    EXPECT_LT(verdict.fraction, 0.5);
    EXPECT_GT(verdict.fraction, 0.2);
    EXPECT_GT(evidence[0].obstacle_pixels, 0u);
    EXPECT_EQ(verdict.sampled_step, 0);
    const PathVerdict away = test.CheckPath(std::vector<Configuration>{{1.4, 0, 0}, {3, 0, 0}});
    EXPECT_TRUE(away.verdict.free());
    EXPECT_EQ(away.sampled_step, 0) << "proven";
  }
}

TEST_F(DrawnTest, ClearanceOfAMotionIsNoMoreThanOfAnyPlaceOnIt) {
  const auto [balls, images] = arm_.SomeScene(random_, 1);
  const DistanceImages distances = DistancesTo(ObstaclePlanes(images));
  size_t free = 0;
  size_t sampled = 0;
  const CollisionChecker test(table_, images, {});
  const ClearanceMeter meter(test, images, {}, {}, distances);
  for (int i = 0; i < 200; ++i) {
    const std::vector<Configuration> path = {DrawnArm::Any(random_), DrawnArm::Any(random_)};
    std::optional<PathClearance> narrowest;
    const PathVerdict verdict = test.CheckPath(
        path, {},
        {.resolution = i % 2 == 0 ? kMotionResolution : 0.4,
         .tested = [&](const TestedPlace& place) { meter.Narrow(place, narrowest); }});
    if (!verdict.verdict.free()) continue;
    ++free;
    ASSERT_TRUE(narrowest);
    if (verdict.sampled_step > 0) {
      ++sampled;
      ASSERT_EQ(narrowest->pixels(), 0) << "between the samples nothing is known";
    }
    for (int step = 0; step <= 50; ++step) {
      Configuration q = path[0];
      for (size_t j = 0; j < 3; ++j) q[j] += step / 50.0 * (path[1][j] - path[0][j]);
      ASSERT_LE(narrowest->pixels(), meter.Measure(q, test.Check(q)).value_or(0));
    }
  }
  EXPECT_GT(free, 5u);
  EXPECT_GT(sampled, 0u);
}

TEST_F(DrawnTest, WhatIsGivenUpIsUnknownAndTestsNoMore) {
  const auto [balls, images] = arm_.SomeScene(random_, 3);
  for (const Preset preset : kPresets) {
    const CollisionChecker test(table_, images, {.preset = preset}, Prepared(images));
    for (int i = 0; i < 20; ++i) {
      const std::vector<Configuration> path = {DrawnArm::Any(random_), DrawnArm::Any(random_),
                                               DrawnArm::Any(random_)};
      const PathVerdict whole = test.CheckPath(path);
      EXPECT_FALSE(whole.stopped);
      const int64_t most = whole.checked / 2;
      int64_t asked = 0;
      int64_t looked = 0;
      const PathVerdict verdict = test.CheckPath(path, {},
                                                 {.tested = [&](const TestedPlace&) { ++looked; },
                                                  .stop = [&] { return ++asked > most; }});
      EXPECT_TRUE(verdict.stopped);
      EXPECT_EQ(verdict.verdict.state(), State::kUnknown);
      EXPECT_LE(looked, most);
    }
    int asked = 0;
    EXPECT_EQ(test.CheckTile(0, [&] { return ++asked > 20; }), std::nullopt);
    EXPECT_EQ(asked, 21);
  }
}

TEST_F(DrawnTest, MapIsWhatChecksOfItsConfigurationsAre) {
  const ConfigurationGrid& grid = table_.grid();
  for (int scene = 0; scene < 4; ++scene) {
    auto [balls, images] = arm_.SomeScene(random_, 2);
    if (scene == 3) images[1].reset();
    for (const Preset preset : kPresets) {
      const CollisionChecker test(table_, images, {.preset = preset}, Prepared(images));
      const TileVerdicts tile = test.CheckTile(0);
      for (ConfigurationNumber number = 0; number < kTileSize; ++number) {
        if (!grid.Contains(number)) continue;
        const State state = test.Check(number).state();
        EXPECT_EQ(tile.free[number / 64] >> (number % 64) & 1, state == State::kFree ? 1u : 0u);
        EXPECT_EQ(tile.occupied[number / 64] >> (number % 64) & 1,
                  state == State::kOccupied ? 1u : 0u);
      }
    }
  }
}

TEST_F(DrawnTest, TheTableKnowsItsGridAndRefusesAnotherRobot) {
  EXPECT_EQ(table_.Count(RobotImageState::kPresent), table_.grid().size());
  EXPECT_EQ(table_.Count(RobotImageState::kMissing), 0u);
  EXPECT_EQ(table_.state(table_.grid().number_limit()), RobotImageState::kMissing);
  EXPECT_FALSE(table_.in_memory());
  for (int view = 0; view < 4; ++view) {
    const Mask& permanent = table_.permanent(view);
    EXPECT_FALSE(permanent.Empty());
    for (int i = 0; i < 20; ++i) {
      const Mask image = arm_.robot()->Touched(DrawnArm::Any(random_))[static_cast<size_t>(view)];
      EXPECT_TRUE((permanent - image).Empty());
      EXPECT_TRUE((image - table_.covered(view)).Empty());
    }
  }
  EXPECT_THROW(RobotImageTable::Drawn(DrawnArm::Grid(), nullptr), std::invalid_argument);
  EXPECT_THROW(
      RobotImageTable::Drawn(
          ConfigurationGrid({{.name = "turn", .lower = 0, .upper = 1, .steps = 2}}), arm_.robot()),
      std::invalid_argument);
  EXPECT_THROW(RobotImageTable::Drawn(
                   ConfigurationGrid({{.name = "turn", .lower = 0, .upper = 1, .steps = 2},
                                      {.name = "lift", .lower = 0, .upper = 2.1, .steps = 2},
                                      {.name = "reach"}}),
                   arm_.robot()),
               std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
