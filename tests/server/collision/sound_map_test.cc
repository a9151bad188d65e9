// SPDX-License-Identifier: Apache-2.0
// The sound presets in a world of spheres: tiles, places off the grid, ways, and the body.
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/random.h"
#include "tests/server/collision/sound_world.h"

namespace silhouette {
namespace {

using namespace testing::sound;  // NOLINT(google-build-using-namespace)
using testing::BallCamera;
using testing::Balls;
using testing::SphereWorld;
using testing::Vector3d;

TEST(SoundMapTest, TilesAreWhatSingleChecksAre) {
  const SphereWorld& world = PerspectiveWorld();
  const ConfigurationNumber present = SphereWorld::Configurations()[123];
  std::mt19937_64 random(3);
  const Balls obstacles = RandomObstacles(SphereWorld::Arm(present), random);
  const ObstacleImages images = world.See(obstacles, present);
  const PossibleSpace possible(world.space, images, world.Body(present));
  for (Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
    const CollisionChecker test(world.table, images, {.preset = preset},
                                WithBody(possible, present));
    int occupied = 0;
    for (uint64_t tile = 0; tile < world.table.grid().tiles(); ++tile) {
      const TileVerdicts verdicts = test.CheckTile(tile);
      for (uint64_t place = 0; place < kTileSize; ++place) {
        const State state = test.Check(tile * kTileSize + place).state();
        const uint64_t bit = uint64_t{1} << (place % 64);
        EXPECT_EQ((verdicts.free[place / 64] & bit) != 0, state == State::kFree);
        EXPECT_EQ((verdicts.occupied[place / 64] & bit) != 0, state == State::kOccupied);
        if (state == State::kOccupied) ++occupied;
      }
    }
    EXPECT_GT(occupied, 0);
  }
}

TEST(SoundMapTest, OffTheGridACellIsTheUnionOfItsCorners) {
  const SphereWorld& world = PerspectiveWorld();
  const ConfigurationNumber present = SphereWorld::Configurations()[123];
  const Balls obstacles{{Vector3d(0.45, -0.3, 0.05), 0.1}};
  const ObstacleImages images = world.See(obstacles, present);
  const PossibleSpace possible(world.space, images, world.Body(present));
  const CollisionChecker test(world.table, images, {.preset = Preset::kSound}, Without(possible));
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> angle(0, 2 * std::numbers::pi);
  for (int i = 0; i < SampleCount(300); ++i) {
    const Configuration q{angle(random), angle(random)};
    const CellCorners corners = world.table.grid().CornersAround(q);
    for (ConfigurationNumber corner : corners.numbers()) {
      if (test.Check(corner).state() == State::kOccupied) {
        EXPECT_EQ(test.Check(q).state(), State::kOccupied);
      }
    }
  }
}

TEST(SoundMapTest, TheBodyFreesNothingThatTouchesBetweenGridPoints) {
  Random random;
  const SphereWorld& world = PerspectiveWorld();
  std::uniform_real_distribution<double> angle(0, 2 * std::numbers::pi);
  int touching = 0;
  int freed = 0;
  for (int scene = 0; scene < SampleCount(10); ++scene) {
    const ConfigurationNumber present = RandomConfiguration(random);
    const Balls obstacles = RandomObstacles(SphereWorld::Arm(present), random);
    const ObstacleImages images = world.See(obstacles, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    for (Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      const CollisionChecker without(world.table, images, {.preset = preset}, Without(possible));
      const CollisionChecker with(world.table, images, {.preset = preset},
                                  WithBody(possible, present));
      for (int i = 0; i < 400; ++i) {
        const Configuration q{angle(random), angle(random)};
        if (with.Check(q).free() && !without.Check(q).free()) ++freed;
        if (!Touch(testing::ArmAt(q[0], q[1]), obstacles)) continue;
        ++touching;
        // The corners' images may lack what lies between them; the body takes nothing more away.
        EXPECT_EQ(with.Check(q).state(), without.Check(q).state()) << "scene " << scene;
      }
    }
  }
  EXPECT_GT(touching, SampleCount(100));
  EXPECT_GT(freed, SampleCount(100));
}

// What the robot does not meet on its straight way is free, and a path asks about all of itself.
TEST(SoundMapTest, WhatIsNotMetOnTheWayIsFree) {
  const SphereWorld& world = PerspectiveWorld();
  const ConfigurationNumber present = SphereWorld::Configurations()[123];
  const Balls obstacles{{Vector3d(0.45, -0.3, 0.05), 0.1}};
  ObstacleImages images = world.See(obstacles, present);
  // As if the robot hid it: what is plainly seen would be met.
  for (auto& image : images) {
    image = ObstacleImage::FromScene(~image->Background(), ~image->Background());
  }
  const PossibleSpace possible(world.space, images, world.Body(present));
  bool meets = true;
  std::vector<std::pair<Configuration, Configuration>> asked;
  TestSupport support = Without(possible);
  support.robot_may_meet = [&](std::span<const double> from, std::span<const double> to) {
    asked.emplace_back(Configuration(from.begin(), from.end()),
                       Configuration(to.begin(), to.end()));
    return meets;
  };
  const CollisionChecker test(world.table, images, {.preset = Preset::kSound}, support);
  const CollisionChecker planes(world.table, images, {.preset = Preset::kSoundPlanes}, support);
  const CollisionChecker without(world.table, images, {.preset = Preset::kSound},
                                 Without(possible));
  int occupied = 0;
  for (ConfigurationNumber number : SphereWorld::Configurations()) {
    meets = true;
    EXPECT_EQ(test.Check(number), without.Check(number));
    if (without.Check(number).free()) continue;
    ++occupied;
    asked.clear();
    meets = false;
    EXPECT_TRUE(test.Check(number).free());
    EXPECT_EQ(test.CheckTile(number / kTileSize).occupied[0], 0u);
    ASSERT_FALSE(asked.empty());
    EXPECT_EQ(asked.front().first, SphereWorld::Grid().At(number));
    EXPECT_EQ(asked.front().second, asked.front().first);
    const size_t before = asked.size();
    EXPECT_EQ(planes.Check(number).state(), State::kOccupied);
    EXPECT_EQ(asked.size(), before);
    if (occupied > 20) break;
  }
  ASSERT_GT(occupied, 20);
  const Configuration start{0.1, 0.2};
  const Configuration end{4.3, 1.1};
  asked.clear();
  EXPECT_TRUE(test.CheckPath(std::vector{start, end}).verdict.free());
  ASSERT_GT(asked.size(), 3u);
  const double step = SphereWorld::Grid().joints()[0].step();
  for (const auto& [from, to] : asked) {
    for (size_t j = 0; j < from.size(); ++j) {
      EXPECT_LE(from[j], to[j]);
      EXPECT_LE(to[j] / step, std::floor(from[j] / step + 1e-9) + 1 + 1e-9) << "not of one cell";
    }
  }
}

// Where balls are met nowhere, what the views show is left, and the body may touch everything.
TEST(SoundMapTest, WhatAllViewsButOneShowIsMetHoweverThinItIs) {
  const SphereWorld& world = PerspectiveWorld();
  const ConfigurationNumber present = *SphereWorld::Grid().Nearest(std::vector<double>{0.0, 0.0});
  const Balls finger{{Vector3d(-0.3, -0.3, 0.05), 0.01}};
  const ObstacleImages images = world.See(finger, present);
  const PossibleSpace possible(world.space, images, world.Body(present));
  TestSupport support = Without(possible);
  support.robot_may_meet = [](std::span<const double>, std::span<const double>) { return false; };
  const CollisionChecker test(world.table, images, {.preset = Preset::kSound}, support);
  int touching = 0;
  for (ConfigurationNumber number : SphereWorld::Configurations()) {
    if (!Touch(SphereWorld::Arm(number), finger)) continue;
    ++touching;
    EXPECT_EQ(test.Check(number).state(), State::kOccupied);
  }
  EXPECT_GT(touching, 0);
}

// So nothing is met where the robot stands, however close it is.
TEST(SoundMapTest, WhatTheViewsShowIsMetOnlyWhereTheRobotImagesHoldIt) {
  Random random;
  const SphereWorld& world = PerspectiveWorld();
  int opened = 0;
  for (int scene = 0; scene < SampleCount(5); ++scene) {
    const ConfigurationNumber present = RandomConfiguration(random);
    const Balls obstacles = RandomObstacles(SphereWorld::Arm(present), random);
    const ObstacleImages images = world.See(obstacles, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    TestSupport support = Without(possible);
    const CollisionChecker without(world.table, images, {.preset = Preset::kSound}, support);
    support.robot_may_meet = [](std::span<const double>, std::span<const double>) { return false; };
    const CollisionChecker test(world.table, images, {.preset = Preset::kSound}, support);
    const CollisionChecker views(world.table, images, {.preset = Preset::kUncalibrated});
    EXPECT_TRUE(test.Check(present).free()) << "scene " << scene;
    for (ConfigurationNumber number : SphereWorld::Configurations()) {
      if (!views.Check(number).free()) continue;
      EXPECT_TRUE(test.Check(number).free()) << "scene " << scene;
      if (!without.Check(number).free()) ++opened;
    }
  }
  EXPECT_GT(opened, 0);
}

// The steps to the neighbouring grid points, diagonal ones included, that are free.
int FreeSteps(const CollisionChecker& test, ConfigurationNumber from) {
  const ConfigurationGrid grid = SphereWorld::Grid();
  const Configuration start = grid.At(from);
  int free = 0;
  for (int a : {-1, 0, 1}) {
    for (int b : {-1, 0, 1}) {
      if (a == 0 && b == 0) continue;
      const Configuration end{start[0] + a * grid.joints()[0].step(),
                              start[1] + b * grid.joints()[1].step()};
      const std::vector<Configuration> path{start, end};
      if (test.CheckPath(path).verdict.free()) ++free;
    }
  }
  return free;
}

// Without the body the images of the robot's own place, which cover all that it hides, refuse every
// step.
TEST(SoundMapTest, TheBodyOpensStepsAwayFromAPerson) {
  Random random;
  const SphereWorld& world = PerspectiveWorld();
  std::uniform_real_distribution<double> place(-0.7, 0.7);
  int scenes = 0;
  int steps = 0;
  int steps_without_body = 0;
  while (scenes < 30) {
    const ConfigurationNumber present = RandomConfiguration(random);
    const testing::Ball person{{place(random), place(random), 0.5 * place(random)}, 0.12};
    const double distance =
        testing::DistanceTo(SphereWorld::Arm(present), person.centre) - person.radius;
    if (distance < 0.1 || distance > 0.3) continue;
    const ObstacleImages images = world.See(Balls{person}, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    const CollisionChecker without(world.table, images, {.preset = Preset::kSound},
                                   Without(possible));
    const CollisionChecker with(world.table, images, {.preset = Preset::kSound},
                                WithBody(possible, present));
    if (!with.Check(present).free()) continue;
    ++scenes;
    const int free_without = FreeSteps(without, present);
    const int free_with = FreeSteps(with, present);
    EXPECT_LE(free_without, free_with) << "scene " << scenes;
    steps += free_with;
    steps_without_body += free_without;
  }
  EXPECT_GT(steps, steps_without_body);
}

TEST(SoundMapTest, AnAllowedRegionTakesAwayWhatLiesInItInAllViews) {
  const SphereWorld& world = PerspectiveWorld();
  const ConfigurationNumber present = *SphereWorld::Grid().Nearest(std::vector<double>{0.0, 0.0});
  const Balls part{{Vector3d(-0.3, -0.3, 0.05), 0.08}};
  const ObstacleImages images = world.See(part, present);
  const Balls around{{Vector3d(-0.3, -0.3, 0.05), 0.2}};
  std::vector<std::optional<Mask>> allowed;
  for (const BallCamera& camera : world.cameras) allowed.push_back(camera.See(around));
  const BodyDistance body = world.Body(present);
  EXPECT_GT(PossibleSpace(world.space, images, body).remaining().Count(), 0);
  EXPECT_EQ(PossibleSpace(world.space, images, body, allowed).remaining().Count(), 0);
  allowed[1] = std::nullopt;
  EXPECT_EQ(PossibleSpace(world.space, images, body, allowed).remaining().Count(),
            PossibleSpace(world.space, images, body).remaining().Count());
}

TEST(SoundMapTest, NeedsTheSpaceOfItsScene) {
  const SphereWorld world(ThreeParallelCameras(), 0.1, 0.05);
  const ConfigurationNumber present = SphereWorld::Configurations()[11];
  ObstacleImages images = world.See({}, present);
  const PossibleSpace possible(world.space, images, {});
  const Policy policy{.preset = Preset::kSound};
  EXPECT_THROW(CollisionChecker(world.table, images, policy), std::invalid_argument);
  images[0] = std::nullopt;
  EXPECT_THROW(CollisionChecker(world.table, images, policy, Without(possible)),
               std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
