// SPDX-License-Identifier: Apache-2.0
// The sound presets in a world of spheres: what no camera can see, and what must never be missed.
#include <gtest/gtest.h>

#include "tests/random.h"
#include "tests/server/collision/sound_world.h"

namespace silhouette {
namespace {

using namespace testing::sound;  // NOLINT(google-build-using-namespace)
using testing::BallCamera;
using testing::Balls;
using testing::LookingAt;
using testing::SphereWorld;
using testing::Vector3d;

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

void NeverMisses(const SphereWorld& world, int scenes) {
  Random random;
  int64_t touching = 0;
  for (int scene = 0; scene < SampleCount(scenes); ++scene) {
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

TEST(SoundTest, NeverMissesWithPerspectiveCameras) { NeverMisses(PerspectiveWorld(), 12); }

TEST(SoundTest, NeverMissesWithParallelCameras) { NeverMisses(ParallelWorld(), 20); }

TEST(SoundTest, NeverMissesWhereAViewDoesNotSeeAll) {
  NeverMisses(SphereWorld(CamerasThatDoNotSeeAll(), kSoundRho, kVoxel), 12);
}

// Behind a pillar before the camera robot images lack the robot.
TEST(SoundTest, NeverMissesBehindIgnoredPixels) {
  std::vector<BallCamera> cameras = ThreeCameras();
  std::vector<Mask> pillars;
  for (const BallCamera& camera : cameras) pillars.emplace_back(camera.size());
  pillars[0] = Mask::FromPredicate(cameras[0].size(), [](int x, int) { return x >= 18 && x < 24; });
  pillars[2] = Mask::FromPredicate(cameras[2].size(), [](int, int y) { return y < 16; });
  NeverMisses(SphereWorld(std::move(cameras), kSoundRho, kVoxel, 0, std::move(pillars)), 12);
}

// Nor do they show where it leaves the image there.
TEST(SoundTest, NeverMissesWhatIsBeyondIgnoredPixelsAtTheRim) {
  std::vector<BallCamera> cameras = CamerasThatDoNotSeeAll();
  std::vector<Mask> pillars;
  for (const BallCamera& camera : cameras) {
    const MaskSize size = camera.size();
    pillars.push_back(
        Mask::FromPredicate(size, [size](int x, int) { return x < 4 || x >= size.width - 4; }));
  }
  NeverMisses(SphereWorld(std::move(cameras), kSoundRho, kVoxel, 0, std::move(pillars)), 12);
}

// The scene is of one variant, the check of another: of an arm that carries something,
// or does not. What it carries is not in the model.
TEST(SoundTest, NeverMissesWithAnotherVariantThanTheScenes) {
  Random random;
  const SphereWorld& bare = PerspectiveWorld();
  const SphereWorld carrying(ThreeCameras(), kSoundRho, kVoxel, 0.13);
  int64_t touching = 0;
  for (int scene = 0; scene < 2 * SampleCount(3); ++scene) {
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
  for (int i = 0; i < SampleCount(10); ++i) {
    const ConfigurationNumber present = RandomConfiguration(random);
    const ObstacleImages images = world.See({}, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    EXPECT_EQ(possible.remaining().Count(), 0) << i;
    EXPECT_TRUE(possible.parts().empty());
  }
}

TEST(SoundTest, KnowingNothingOfTheBodyOnlyBlocksMore) {
  const SphereWorld& world = ParallelWorld();
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
  const SphereWorld& world = PerspectiveWorld();
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
  for (int i = 0; i < 5000 && scenes < SampleCount(12); ++i) {
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
  EXPECT_EQ(scenes, SampleCount(12));
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
  const SphereWorld& world = ParallelWorld();
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
  const SphereWorld& world = ParallelWorld();
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

}  // namespace
}  // namespace silhouette
