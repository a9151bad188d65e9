// SPDX-License-Identifier: Apache-2.0
// The sound presets in a world of spheres: what no camera can see, and what must never be missed.
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/random.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

using testing::BallCamera;
using testing::Balls;
using testing::LookingAt;
using testing::SphereWorld;
using testing::Vector2d;
using testing::Vector3d;

constexpr double kSoundRho = 0.06;
constexpr double kVoxel = 0.02;

std::vector<BallCamera> ThreeCameras() {
  return {BallCamera(LookingAt({2.4, 0.4, 1.1}, {0, 0, 0}, {44, 44}, 0.75, -0.15)),
          BallCamera(LookingAt({-1.0, 2.3, 0.6}, {0, 0, 0}, {40, 48}, 0.75, 0.1)),
          BallCamera(LookingAt({-0.3, -0.2, 2.6}, {0, 0, 0}, {44, 44}, 0.75))};
}

std::vector<BallCamera> ThreeParallelCameras() {
  return {BallCamera(Vector3d(0, 0, -1), 40), BallCamera(Vector3d(1, 0, 0), 40),
          BallCamera(Vector3d(-1, 1, -1), 40)};
}

// The second sees only a part of what the robot reaches.
std::vector<BallCamera> CamerasThatDoNotSeeAll() {
  return {BallCamera(LookingAt({2.4, 0.4, 1.1}, {0, 0, 0}, {44, 44}, 0.75)),
          BallCamera(LookingAt({-1.0, 2.3, 0.6}, {0.3, 0.2, 0}, {40, 40}, 0.3)),
          BallCamera(LookingAt({-0.3, -0.2, 2.6}, {0, 0, 0}, {44, 44}, 0.75))};
}

ConfigurationNumber RandomConfiguration(std::mt19937_64& random) {
  const std::vector<ConfigurationNumber> all = SphereWorld::Configurations();
  return all[std::uniform_int_distribution<size_t>(0, all.size() - 1)(random)];
}

// One to four obstacles of at least the least size, none of which touches the robot.
Balls RandomObstacles(const Balls& robot, std::mt19937_64& random) {
  std::uniform_real_distribution<double> place(-0.75, 0.75);
  std::uniform_real_distribution<double> radius(kSoundRho, 0.15);
  Balls obstacles;
  const int count = std::uniform_int_distribution<int>(1, 4)(random);
  while (static_cast<int>(obstacles.size()) < count) {
    const testing::Ball ball{{place(random), place(random), 0.6 * place(random)}, radius(random)};
    if (!Touch(robot, Balls{ball})) obstacles.push_back(ball);
  }
  return obstacles;
}

// The middle between two configurations, and how far every joint may be from it.
struct Range {
  Range(std::span<const double> from, std::span<const double> to) {
    for (size_t j = 0; j < from.size(); ++j) {
      half.push_back((to[j] - from[j]) / 2);
      middle.push_back(from[j] + half[j]);
    }
  }
  Configuration middle;
  Configuration half;
};

// With the true body: balls that are where they are at present touch nothing, as now. In a grid
// cell, those of its middle, grown by how far they move.
TestSupport WithBody(const PossibleSpace& possible, ConfigurationNumber present) {
  const auto may_touch = [present](std::span<const double> from, std::span<const double> to,
                                   const Eigen::AlignedBox3d& box) {
    const Range cell(from, to);
    const Balls now = SphereWorld::Arm(present);
    const Balls then = testing::ArmAt(cell.middle[0], cell.middle[1]);
    const Vector3d elbow = then[4].centre;
    for (size_t i = 0; i < then.size(); ++i) {
      const double by_pitch = i > 4 ? cell.half[1] * (then[i].centre - elbow).norm() : 0;
      const double growth = by_pitch + cell.half[0] * (then[i].centre.norm() + by_pitch);
      if (growth == 0 && (then[i].centre - now[i].centre).norm() < 1e-9) continue;
      if (box.exteriorDistance(then[i].centre) <= then[i].radius + growth) return true;
    }
    return false;
  };
  return {.bands = nullptr,
          .resolved = nullptr,
          .possible_space = &possible,
          .robot_may_touch = may_touch};
}

TestSupport Without(const PossibleSpace& possible) {
  return {.bands = nullptr,
          .resolved = nullptr,
          .possible_space = &possible,
          .robot_may_touch = nullptr};
}

// Every point of the obstacles that the robot can reach lies in a voxel that remains.
void ExpectHolds(const PossibleSpace& possible, const Balls& obstacles, std::mt19937_64& random) {
  const VoxelSpace& space = possible.space();
  std::uniform_real_distribution<double> share(-1, 1);
  for (int i = 0; i < 2000; ++i) {
    const testing::Ball& ball = obstacles[static_cast<size_t>(i) % obstacles.size()];
    const Vector3d off(share(random), share(random), share(random));
    const Vector3d point = ball.centre + ball.radius * off;
    if (off.norm() > 1 || !testing::kArmBox.contains(point)) continue;
    const Eigen::Vector3i at =
        ((point - space.grid().lower()) / space.grid().edge()).array().floor().cast<int>();
    if (space.reached().at(at.x(), at.y(), at.z())) {
      EXPECT_TRUE(possible.remaining().at(at.x(), at.y(), at.z())) << point.transpose();
    }
  }
}

void NeverMisses(std::vector<BallCamera> cameras, int scenes) {
  Random random;
  const SphereWorld world(std::move(cameras), kSoundRho, kVoxel);
  int64_t touching = 0;
  for (int scene = 0; scene < scenes; ++scene) {
    const ConfigurationNumber present = RandomConfiguration(random);
    const Balls obstacles = RandomObstacles(SphereWorld::Arm(present), random);
    const ObstacleImages images = world.See(obstacles, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    ExpectHolds(possible, obstacles, random);
    const CollisionChecker planes(world.table, images, {.preset = Preset::kSoundPlanes},
                                  Without(possible));
    const CollisionChecker voxels(world.table, images, {.preset = Preset::kSound},
                                  Without(possible));
    const CollisionChecker planes_with_body(world.table, images, {.preset = Preset::kSoundPlanes},
                                            WithBody(possible, present));
    const CollisionChecker with_body(world.table, images, {.preset = Preset::kSound},
                                     WithBody(possible, present));
    for (ConfigurationNumber number : SphereWorld::Configurations()) {
      // Each looks closer than the one before.
      EXPECT_LE(planes.Check(number).free(), voxels.Check(number).free());
      EXPECT_LE(planes.Check(number).free(), planes_with_body.Check(number).free());
      EXPECT_LE(planes_with_body.Check(number).free(), with_body.Check(number).free());
      EXPECT_LE(voxels.Check(number).free(), with_body.Check(number).free());
      if (!Touch(SphereWorld::Arm(number), obstacles)) continue;
      ++touching;
      EXPECT_EQ(planes.Check(number).state(), State::kOccupied) << "scene " << scene;
      EXPECT_EQ(voxels.Check(number).state(), State::kOccupied) << "scene " << scene;
      EXPECT_EQ(planes_with_body.Check(number).state(), State::kOccupied) << "scene " << scene;
      EXPECT_EQ(with_body.Check(number).state(), State::kOccupied) << "scene " << scene;
    }
  }
  EXPECT_GT(touching, 0);
}

TEST(SoundTest, NeverMissesWithPerspectiveCameras) { NeverMisses(ThreeCameras(), 12); }

TEST(SoundTest, NeverMissesWithParallelCameras) { NeverMisses(ThreeParallelCameras(), 20); }

TEST(SoundTest, NeverMissesWhereAViewDoesNotSeeAll) { NeverMisses(CamerasThatDoNotSeeAll(), 12); }

// The scene is of one variant, the check of another: of an arm that carries something,
// or does not. What it carries is not in the model.
TEST(SoundTest, NeverMissesWithAnotherVariantThanTheScenes) {
  Random random;
  const SphereWorld bare(ThreeCameras(), kSoundRho, kVoxel);
  const SphereWorld carrying(ThreeCameras(), kSoundRho, kVoxel, 0.13);
  int64_t touching = 0;
  for (int scene = 0; scene < 6; ++scene) {
    const SphereWorld& seen = scene % 2 == 0 ? bare : carrying;
    const SphereWorld& tested = scene % 2 == 0 ? carrying : bare;
    const ConfigurationNumber present = RandomConfiguration(random);
    const Balls obstacles = RandomObstacles(seen.Robot(present), random);
    const ObstacleImages images = seen.See(obstacles, present);
    const PossibleSpace possible(tested.space, images, tested.Body(present));
    ExpectHolds(possible, obstacles, random);
    const CollisionChecker planes(tested.table, images, {.preset = Preset::kSoundPlanes},
                                  Without(possible));
    const CollisionChecker voxels(tested.table, images, {.preset = Preset::kSound},
                                  Without(possible));
    for (ConfigurationNumber number : SphereWorld::Configurations()) {
      EXPECT_LE(planes.Check(number).free(), voxels.Check(number).free());
      if (!Touch(tested.Robot(number), obstacles)) continue;
      ++touching;
      EXPECT_EQ(planes.Check(number).state(), State::kOccupied) << "scene " << scene;
      EXPECT_EQ(voxels.Check(number).state(), State::kOccupied) << "scene " << scene;
    }
  }
  EXPECT_GT(touching, 0);
}

// Two cameras that look from about the same side, and a ball behind the robot.
struct Hiding {
  Hiding()
      : world({BallCamera(LookingAt({2.5, 0.25, 0.1}, {0, 0, 0}, {64, 64}, 0.6)),
               BallCamera(LookingAt({2.5, -0.25, 0.1}, {0, 0, 0}, {64, 64}, 0.6))},
              0.035, 0.0117),
        present(*SphereWorld::Grid().Nearest(std::vector<double>{std::numbers::pi / 2, 0.0})),
        obstacles{{Vector3d(-0.12, 0.3, 0), 0.035}},
        images(world.See(obstacles, present)),
        possible(world.space, images, world.Body(present)) {
    for (ConfigurationNumber number : SphereWorld::Configurations()) {
      if (Touch(SphereWorld::Arm(number), obstacles)) touching.push_back(number);
    }
  }
  SphereWorld world;
  ConfigurationNumber present;
  Balls obstacles;
  ObstacleImages images;
  PossibleSpace possible;
  std::vector<ConfigurationNumber> touching;
};

const Hiding& TheHiding() {
  static const Hiding hiding;
  return hiding;
}

TEST(SoundTest, FindsWhatTheRobotHidesInAllViewsAndNoOtherPresetDoes) {
  const Hiding& hiding = TheHiding();
  ASSERT_FALSE(Touch(SphereWorld::Arm(hiding.present), hiding.obstacles));
  for (const auto& image : hiding.images) ASSERT_TRUE(image->obstacle().Empty());
  ASSERT_FALSE(hiding.touching.empty());
  Calibration calibration;
  for (const Vector3d& from : {Vector3d(2.5, 0.25, 0.1), Vector3d(2.5, -0.25, 0.1)}) {
    calibration.cameras.push_back(LookingAt(from, {0, 0, 0}, {64, 64}, 0.6));
  }
  const EpipolarBands bands(calibration, hiding.world.table.mask_sizes());
  for (Preset preset : AllPresets()) {
    TestSupport support = Without(hiding.possible);
    support.bands = &bands;
    const CollisionChecker test(hiding.world.table, hiding.images, {.preset = preset}, support);
    for (ConfigurationNumber number : hiding.touching) {
      EXPECT_EQ(test.Check(number).state(), IsSound(preset) ? State::kOccupied : State::kFree)
          << NameOf(preset);
    }
  }
}

TEST(SoundTest, FindsNothingInAnEmptyCell) {
  const SphereWorld world(ThreeParallelCameras(), 0.1, 0.025);
  std::mt19937_64 random(7);
  for (int i = 0; i < 10; ++i) {
    const ConfigurationNumber present = RandomConfiguration(random);
    const ObstacleImages images = world.See({}, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    EXPECT_EQ(possible.remaining().Count(), 0) << i;
    EXPECT_TRUE(possible.parts().empty());
  }
}

TEST(SoundTest, KnowingNothingOfTheBodyOnlyBlocksMore) {
  const SphereWorld world(ThreeParallelCameras(), kSoundRho, kVoxel);
  const ConfigurationNumber present = SphereWorld::Configurations()[57];
  const Balls obstacles{{Vector3d(0.4, -0.4, 0.1), 0.1}};
  const ObstacleImages images = world.See(obstacles, present);
  const PossibleSpace with(world.space, images, world.Body(present));
  const PossibleSpace without(world.space, images, {});
  EXPECT_LT(with.remaining().Count(), without.remaining().Count());
  for (size_t i = 0; i < with.remaining().words().size(); ++i) {
    ASSERT_EQ(with.remaining().words()[i] & ~without.remaining().words()[i], 0u);
  }
}

TEST(SoundTest, KeepsWhatAllViewsSeeHoweverSmallItIs) {
  const SphereWorld world(ThreeCameras(), kSoundRho, kVoxel);
  const ConfigurationNumber present = *SphereWorld::Grid().Nearest(std::vector<double>{0.0, 0.0});
  const Balls finger{{Vector3d(-0.3, -0.3, 0.05), 0.01}};
  const ObstacleImages images = world.See(finger, present);
  const PossibleSpace possible(world.space, images, world.Body(present));
  const CollisionChecker test(world.table, images, {.preset = Preset::kSound},
                              WithBody(possible, present));
  int touching = 0;
  for (ConfigurationNumber number : SphereWorld::Configurations()) {
    if (!Touch(SphereWorld::Arm(number), finger)) continue;
    ++touching;
    EXPECT_EQ(test.Check(number).state(), State::kOccupied);
  }
  EXPECT_GT(touching, 0);
}

// A small ball, or a piece of a forearm, behind the arm as a camera at `camera` sees it.
Balls SmallThingBehind(const Balls& arm, const Vector3d& camera, std::mt19937_64& random) {
  const size_t at = std::uniform_int_distribution<size_t>(0, arm.size() - 2)(random);
  const Vector3d behind = (arm[at].centre - camera).normalized();
  const Vector3d along = arm[at + 1].centre - arm[at].centre;
  const Vector3d from =
      arm[at].centre + std::uniform_real_distribution<double>(0.12, 0.4)(random) * behind;
  Balls thing{{from, 0.03}};
  if (random() % 2 == 0) return thing;
  for (double share : {0.3, 0.6}) thing.push_back({from + share * along, 0.035});
  return thing;
}

TEST(SoundTest, WhatAllViewsButOneSeeIsOccupiedHoweverSmallItIs) {
  Random random;
  const Vector3d fourth(0.9, -2.4, 0.3);
  std::vector<BallCamera> cameras = ThreeCameras();
  cameras.emplace_back(LookingAt(fourth, {0, 0, 0}, {48, 40}, 0.75));
  const SphereWorld world(std::move(cameras), 0.16, 0.04);
  int scenes = 0;
  int found_by_the_rule = 0;
  for (int i = 0; i < 5000 && scenes < 12; ++i) {
    const ConfigurationNumber present = RandomConfiguration(random);
    const Balls arm = SphereWorld::Arm(present);
    const Balls small = SmallThingBehind(arm, fourth, random);
    if (Touch(arm, small)) continue;
    const ObstacleImages images = world.See(small, present);
    bool hidden_in_the_fourth_alone = images[3]->obstacle().Empty();
    for (size_t view = 0; view < 3; ++view) {
      const Mask shows = world.cameras[view].See(small);
      hidden_in_the_fourth_alone =
          hidden_in_the_fourth_alone && (shows & images[view]->unknown()).Empty();
    }
    if (!hidden_in_the_fourth_alone) continue;
    ++scenes;
    const PossibleSpace possible(world.space, images, world.Body(present));
    const PossibleSpace only_what_all_see(world.space, images, world.Body(present), {}, 0);
    const auto checker = [&](Preset preset, const PossibleSpace& space) {
      return CollisionChecker(world.table, images, {.preset = preset}, WithBody(space, present));
    };
    const CollisionChecker planes = checker(Preset::kSoundPlanes, possible);
    const CollisionChecker sound = checker(Preset::kSound, possible);
    const CollisionChecker strict = checker(Preset::kSound, only_what_all_see);
    for (ConfigurationNumber number : SphereWorld::Configurations()) {
      if (!Touch(SphereWorld::Arm(number), small)) continue;
      EXPECT_EQ(planes.Check(number).state(), State::kOccupied) << "scene " << i;
      EXPECT_EQ(sound.Check(number).state(), State::kOccupied) << "scene " << i;
      if (strict.Check(number).free()) ++found_by_the_rule;
    }
  }
  EXPECT_EQ(scenes, 12);
  EXPECT_GT(found_by_the_rule, 0);
}

TEST(SoundTest, AFreeConfigurationHidesNothing) {
  const Hiding& hiding = TheHiding();
  const CollisionChecker sound(hiding.world.table, hiding.images, {.preset = Preset::kSound},
                               WithBody(hiding.possible, hiding.present));
  const CollisionChecker paper(hiding.world.table, hiding.images, {.preset = Preset::kPaper});
  int free = 0;
  for (ConfigurationNumber number : SphereWorld::Configurations()) {
    const Verdict verdict = sound.Check(number);
    if (!verdict.free()) continue;
    ++free;
    EXPECT_FALSE(verdict.hidden_possible());
  }
  EXPECT_GT(free, 0);
  EXPECT_TRUE(paper.Check(hiding.touching.front()).hidden_possible());
}

// Beside the base, in its silhouette, there is always room for something: its pixels are met at any
// configuration. What the body can reach decides.
TEST(SoundTest, WhatTheRobotAlwaysCoversDoesNotBlockAllIfItsBodyIsKnown) {
  const SphereWorld world(ThreeParallelCameras(), kSoundRho, kVoxel);
  const ConfigurationNumber present = *SphereWorld::Grid().Nearest(std::vector<double>{0.0, 0.0});
  const Balls obstacles{{Vector3d(-0.02, -0.15, 0), 0.07}};
  const ObstacleImages images = world.See(obstacles, present);
  const PossibleSpace possible(world.space, images, world.Body(present));
  ASSERT_FALSE(possible.always_met().Empty());
  const Policy policy{.preset = Preset::kSoundPlanes};
  const CollisionChecker without(world.table, images, policy, Without(possible));
  const CollisionChecker with(world.table, images, policy, WithBody(possible, present));
  int free = 0;
  for (ConfigurationNumber number : SphereWorld::Configurations()) {
    EXPECT_FALSE(without.Check(number).free());
    if (with.Check(number).free()) ++free;
  }
  EXPECT_GT(free, 0);
}

TEST(SoundTest, AMissingViewIsNeverFree) {
  const SphereWorld world(ThreeParallelCameras(), kSoundRho, kVoxel);
  const ConfigurationNumber present = SphereWorld::Configurations()[11];
  const Balls obstacles{{Vector3d(0.4, -0.4, 0.1), 0.1}};
  for (size_t missing = 0; missing < 3; ++missing) {
    ObstacleImages images = world.See(obstacles, present);
    images[missing] = std::nullopt;
    const PossibleSpace possible(world.space, images, world.Body(present));
    for (Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      const CollisionChecker test(world.table, images, {.preset = preset}, Without(possible));
      for (ConfigurationNumber number : SphereWorld::Configurations()) {
        const Verdict verdict = test.Check(number);
        EXPECT_NE(verdict.state(), State::kFree);
        if (Touch(SphereWorld::Arm(number), obstacles)) {
          EXPECT_EQ(verdict.state(), State::kOccupied);
        }
      }
      const TileVerdicts tile = test.CheckTile(0);
      for (uint64_t word : tile.free) EXPECT_EQ(word, 0u);
    }
  }
}

TEST(SoundTest, TilesAreWhatSingleChecksAre) {
  const SphereWorld world(ThreeCameras(), kSoundRho, kVoxel);
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

TEST(SoundTest, OffTheGridACellIsTheUnionOfItsCorners) {
  const SphereWorld world(ThreeCameras(), kSoundRho, kVoxel);
  const ConfigurationNumber present = SphereWorld::Configurations()[123];
  const Balls obstacles{{Vector3d(0.45, -0.3, 0.05), 0.1}};
  const ObstacleImages images = world.See(obstacles, present);
  const PossibleSpace possible(world.space, images, world.Body(present));
  const CollisionChecker test(world.table, images, {.preset = Preset::kSound}, Without(possible));
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> angle(0, 2 * std::numbers::pi);
  for (int i = 0; i < 300; ++i) {
    const Configuration q{angle(random), angle(random)};
    const CellCorners corners = world.table.grid().CornersAround(q);
    for (ConfigurationNumber corner : corners.numbers()) {
      if (test.Check(corner).state() == State::kOccupied) {
        EXPECT_EQ(test.Check(q).state(), State::kOccupied);
      }
    }
  }
}

TEST(SoundTest, TheBodyFreesNothingThatTouchesBetweenGridPoints) {
  Random random;
  const SphereWorld world(ThreeCameras(), kSoundRho, kVoxel);
  std::uniform_real_distribution<double> angle(0, 2 * std::numbers::pi);
  int touching = 0;
  int freed = 0;
  for (int scene = 0; scene < 10; ++scene) {
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
  EXPECT_GT(touching, 100);
  EXPECT_GT(freed, 100);
}

// What the robot does not meet on its straight way is free, and a path asks about all of itself.
TEST(SoundTest, WhatIsNotMetOnTheWayIsFree) {
  const SphereWorld world(ThreeCameras(), kSoundRho, kVoxel);
  const ConfigurationNumber present = SphereWorld::Configurations()[123];
  const Balls obstacles{{Vector3d(0.45, -0.3, 0.05), 0.1}};
  const ObstacleImages images = world.See(obstacles, present);
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
TEST(SoundTest, TheBodyOpensStepsAwayFromAPerson) {
  Random random;
  const SphereWorld world(ThreeCameras(), kSoundRho, kVoxel);
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

TEST(SoundTest, AnAllowedRegionTakesAwayWhatLiesInItInAllViews) {
  const SphereWorld world(ThreeCameras(), kSoundRho, kVoxel);
  const ConfigurationNumber present = *SphereWorld::Grid().Nearest(std::vector<double>{0.0, 0.0});
  const Balls part{{Vector3d(-0.3, -0.3, 0.05), 0.08}};
  const ObstacleImages images = world.See(part, present);
  const Balls around{{Vector3d(-0.3, -0.3, 0.05), 0.2}};
  std::vector<std::optional<Mask>> allowed;
  for (const BallCamera& camera : world.cameras) allowed.push_back(camera.See(around));
  const RobotVoxels body = world.Body(present);
  EXPECT_GT(PossibleSpace(world.space, images, body).remaining().Count(), 0);
  EXPECT_EQ(PossibleSpace(world.space, images, body, allowed).remaining().Count(), 0);
  allowed[1] = std::nullopt;
  EXPECT_EQ(PossibleSpace(world.space, images, body, allowed).remaining().Count(),
            PossibleSpace(world.space, images, body).remaining().Count());
}

TEST(SoundTest, NeedsTheSpaceOfItsScene) {
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
