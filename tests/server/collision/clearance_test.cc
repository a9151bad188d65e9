// SPDX-License-Identifier: Apache-2.0
// Clearance: the verdict stays while the robot images grow by no more, and turns as soon as they
// do.
#include "server/collision/clearance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "tests/random.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/random_geometry.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

constexpr double kClearanceInfinity = std::numeric_limits<double>::infinity();
constexpr double kLittle = 1e-9;
constexpr double kBeyondAnyImage = 100;

ConfigurationGrid ClearanceSmallGrid() {
  return ConfigurationGrid(
      {{.name = "a", .lower = 0, .upper = 2, .steps = 3},
       {.name = "b", .lower = 0, .upper = 2 * std::numbers::pi, .steps = 4, .continuous = true}});
}

// Few pixels each, so that there is room between them.
RobotImageTable ClearanceSparseTable(const std::vector<MaskSize>& sizes, std::mt19937_64& random) {
  const ConfigurationGrid grid = ClearanceSmallGrid();
  RobotImageTable::Builder builder(grid, sizes);
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    std::vector<Mask> masks;
    for (MaskSize size : sizes) masks.push_back(RandomMask(size, 0.03, random));
    builder.Add(number, masks);
  }
  return std::move(builder).Build();
}

RobotImageTable GrownTable(const RobotImageTable& table, double radius) {
  RobotImageTable::Builder builder(table.grid(),
                                   {table.mask_sizes().begin(), table.mask_sizes().end()});
  for (ConfigurationNumber number = 0; number < table.grid().number_limit(); ++number) {
    if (!table.grid().Contains(number)) continue;
    std::vector<Mask> masks;
    for (int view = 0; view < table.views(); ++view) {
      masks.push_back(Grown((*table.Images(number))[view], radius));
    }
    builder.Add(number, masks);
  }
  return std::move(builder).Build();
}

// A random cell and scene under one policy.
struct MeasuredCell {
  MeasuredCell(const Policy& the_policy, int views, std::mt19937_64& random)
      : policy(the_policy),
        sizes(RandomSizes(views, random)),
        table(ClearanceSparseTable(sizes, random)),
        images(RandomImages(sizes, random)),
        bands(RandomCalibration(views, 0.2, random), sizes) {
    if (random() % 5 == 0) images[random() % images.size()].reset();
    resolved = ResolvedObstacleImages(images, bands);
    planes = policy.preset == Preset::kPaperCalibrated ? resolved : ObstaclePlanes(images);
    distances = DistancesTo(planes);
  }

  // From scenes with next to no obstacles to such with many, and the same for errors.
  static ObstacleImages RandomImages(const std::vector<MaskSize>& sizes, std::mt19937_64& random) {
    const double foreground = random() % 2 == 0 ? 0.01 : 0.06;
    const double robot = random() % 2 == 0 ? 0.06 : 0.3;
    ObstacleImages images;
    for (MaskSize size : sizes) {
      images.push_back(ObstacleImage::FromScene(RandomMask(size, foreground, random),
                                                RandomMask(size, robot, random)));
    }
    return images;
  }

  TestSupport support() const { return {.bands = &bands}; }
  CollisionChecker Test(const RobotImageTable& with) const {
    return CollisionChecker(with, images, policy, support());
  }
  ClearanceMeter Meter(const CollisionChecker& test) const {
    return ClearanceMeter(test, images, policy, support(), distances);
  }

  Policy policy;
  std::vector<MaskSize> sizes;
  RobotImageTable table;
  ObstacleImages images;
  EpipolarBands bands;
  CollisionImages resolved;
  CollisionImages planes;
  DistanceImages distances;
};

struct Clearances : ::testing::Test {
  Random random;

  int AnyOf(int least, int most) { return std::uniform_int_distribution(least, most)(random); }

  Policy RandomPolicy(int views) {
    Policy policy{.preset = AllPresets()[AnyOf(0, 3)]};
    if (random() % 2 == 0) policy.min_views = AnyOf(1, views);
    if (random() % 2 == 0) policy.off_grid = OffGrid::kNearest;
    return policy;
  }

  // On the grid, between its values, and seldom outside.
  Configuration RandomConfiguration() {
    if (random() % 2 == 0) return {1.0 * AnyOf(0, 2), std::numbers::pi / 2 * AnyOf(0, 3)};
    return {std::uniform_real_distribution(0.0, 2.1)(random),
            std::uniform_real_distribution(0.0, 6.0)(random)};
  }
};

TEST_F(Clearances, RobotImagesMayGrowByTheClearanceAndByNoMore) {
  int free = 0, touching = 0, infinite = 0, without = 0;
  for (int round = 0; round < 300; ++round) {
    const int views = AnyOf(1, 4);
    const MeasuredCell cell(RandomPolicy(views), views, random);
    const CollisionChecker test = cell.Test(cell.table);
    const ClearanceMeter meter = cell.Meter(test);
    for (int i = 0; i < 4; ++i) {
      const Configuration q = RandomConfiguration();
      const Verdict verdict = test.Check(q);
      const std::optional<double> clearance = meter.Measure(q, verdict);
      if (verdict.state() == State::kUnknown) {
        ++without;
        EXPECT_EQ(clearance, std::nullopt);
        continue;
      }
      ASSERT_TRUE(clearance);
      if (verdict.state() == State::kOccupied) {
        EXPECT_EQ(*clearance, 0);
        continue;
      }
      ++free;
      if (*clearance == 0) ++touching;
      if (*clearance == kClearanceInfinity) ++infinite;
      const double most = std::min(*clearance, kBeyondAnyImage);
      const RobotImageTable grown = GrownTable(cell.table, most);
      EXPECT_EQ(cell.Test(grown).Check(q).state(), State::kFree) << *clearance;
      if (*clearance == kClearanceInfinity) continue;
      const RobotImageTable more = GrownTable(cell.table, *clearance + kLittle);
      EXPECT_EQ(cell.Test(more).Check(q).state(), State::kOccupied) << *clearance;
    }
  }
  EXPECT_GT(free, 100);
  EXPECT_GT(without, 0);
  EXPECT_GT(touching, 0);
  EXPECT_GT(infinite, 0);
  EXPECT_GT(free - touching - infinite, 50);
}

TEST_F(Clearances, SmallestOnAPathIsThatOfThePlacesTested) {
  int free = 0, occupied = 0;
  for (int round = 0; round < 300; ++round) {
    const int views = AnyOf(2, 4);
    const MeasuredCell cell(RandomPolicy(views), views, random);
    const CollisionChecker test = cell.Test(cell.table);
    const ClearanceMeter meter = cell.Meter(test);
    std::vector<Configuration> waypoints;
    for (int i = AnyOf(1, 3); i > 0; --i) waypoints.push_back(RandomConfiguration());
    std::optional<PathClearance> smallest;
    double least = kClearanceInfinity;
    std::optional<std::pair<int, double>> first_place;
    const PathVerdict path = test.CheckPath(
        waypoints, {}, {.tested = [&](const TestedPlace& place) {
          meter.Narrow(place, smallest);
          EXPECT_EQ(place.verdict, test.Check(place.configuration));
          const std::optional<double> here = meter.Measure(place.configuration, place.verdict);
          if (here && (*here < least || !first_place)) {
            least = *here;
            first_place = {place.segment, place.fraction};
          }
        }});
    if (path.verdict.state() == State::kUnknown) continue;
    ASSERT_TRUE(smallest && first_place);
    EXPECT_EQ(smallest->pixels(), least);
    if (path.verdict.free()) {
      ++free;
      EXPECT_EQ(std::pair(smallest->segment, smallest->fraction), *first_place);
      EXPECT_EQ(meter.Measure(smallest->configuration, test.Check(smallest->configuration)), least);
    } else {
      ++occupied;
      EXPECT_EQ(smallest->pixels(), 0);
    }
  }
  EXPECT_GT(free, 10);
  EXPECT_GT(occupied, 10);
}

// One row of pixels a view; the robot is the first pixel, an obstacle is `places[view]` pixels on,
// nowhere if that is 0.
struct ClearanceRow {
  explicit ClearanceRow(const std::vector<int>& places) : sizes(places.size(), MaskSize{20, 1}) {
    for (const int place : places) {
      images.push_back(ObstacleImage::FromObstacles(
          Mask::FromPredicate({20, 1}, [&](int x, int) { return place > 0 && x == place; }),
          Mask({20, 1})));
    }
    RobotImageTable::Builder builder(
        ConfigurationGrid({{.name = "a", .lower = 0, .upper = 0, .steps = 1}}), sizes);
    const Mask robot = Mask::FromPredicate({20, 1}, [](int x, int) { return x == 0; });
    builder.Add(0, std::vector<Mask>(places.size(), robot));
    table = std::move(builder).Build();
  }

  std::optional<double> Clearance(int min_views, std::span<ViewEvidence> evidence = {}) const {
    const Policy policy{.min_views = min_views};
    const CollisionChecker test(*table, images, policy);
    const DistanceImages distances = DistancesTo(ObstaclePlanes(images));
    const Configuration q = {0};
    return ClearanceMeter(test, images, policy, {}, distances).Measure(q, test.Check(q), evidence);
  }

  std::vector<MaskSize> sizes;
  ObstacleImages images;
  std::optional<RobotImageTable> table;
};

TEST(Clearance, IsTheDistanceInThatViewThatWouldMakeItOccupied) {
  const ClearanceRow row({6, 3, 0});
  EXPECT_EQ(row.Clearance(1), 2);
  EXPECT_EQ(row.Clearance(2), 5);
  EXPECT_EQ(row.Clearance(3), kClearanceInfinity) << "a view shows no obstacle at all";
}

TEST(Clearance, OfAFreeConfigurationThatTouchesAnObstacleIsNone) {
  EXPECT_EQ(ClearanceRow({1}).Clearance(1), 0);
  EXPECT_EQ(ClearanceRow({2}).Clearance(1), 1);
}

TEST(Clearance, TellsTheDistanceInEveryView) {
  ClearanceRow row({6, 3, 0});
  std::vector<ViewEvidence> evidence(3);
  row.Clearance(1, evidence);
  EXPECT_EQ(evidence[0].distance, 5);
  EXPECT_EQ(evidence[1].distance, 2);
  EXPECT_EQ(evidence[2].distance, kClearanceInfinity);
}

TEST(Clearance, MissingViewIsNoReasonToTellOne) {
  ClearanceRow row({6, 3, 0});
  row.images[2].reset();
  std::vector<ViewEvidence> evidence(3);
  EXPECT_EQ(row.Clearance(2, evidence), std::nullopt) << "the verdict is unknown";
  EXPECT_EQ(evidence[0].distance, std::nullopt);
  EXPECT_EQ(row.Clearance(1, evidence), 0) << "the view counts as showing an obstacle";
  EXPECT_EQ(evidence[0].distance, 5);
  EXPECT_EQ(evidence[2].distance, std::nullopt);
}

TEST(Clearance, UnknownPixelsDoNotMakeItSmaller) {
  ClearanceRow row({6});
  const Mask robot = Mask::FromPredicate({20, 1}, [](int x, int) { return x < 4; });
  row.images[0] = ObstacleImage::FromScene(row.images[0]->obstacle() | robot, robot);
  EXPECT_EQ(row.Clearance(1), 5);
}

TEST(Clearance, DistancesOfAnotherSceneAreRefused) {
  const ClearanceRow row({6, 3});
  const Policy policy;
  const CollisionChecker test(*row.table, row.images, policy);
  EXPECT_THROW(ClearanceMeter(test, row.images, policy, {}, {}), std::invalid_argument);
  const DistanceImages small = DistancesTo({Mask({3, 3}), Mask({3, 3})});
  EXPECT_THROW(ClearanceMeter(test, row.images, policy, {}, small), std::invalid_argument);
}

using testing::BallCamera;
using testing::Balls;
using testing::LookingAt;
using testing::SphereWorld;
using testing::Vector3d;

// The robot images of a configuration, grown, as the possible space asks for them.
struct GrownRobot {
  GrownRobot(const RobotImageTable& table, ConfigurationNumber number, double radius) {
    for (int view = 0; view < table.views(); ++view) {
      masks.push_back(Grown((*table.Images(number))[view], radius));
    }
    for (const Mask& mask : masks) words.push_back(mask.words());
  }
  std::vector<Mask> masks;
  std::vector<MaskWords> words;
};

// Whether a robot image meets a part whose planes are grown in enough views.
bool ClearanceMeets(const PossibleSpace::Part& part, double level, const GrownRobot& robot,
                    int min_views) {
  int met = 0;
  for (size_t view = 0; view < part.planes.size(); ++view) {
    const bool outside = part.beyond[view] && robot.masks[view].Empty();
    const Mask grown = Grown(*part.planes[view], level);
    if (outside || Intersects(grown.words(), robot.words[view])) ++met;
  }
  return met >= min_views;
}

struct SoundClearances : Clearances {
  const SphereWorld world{{BallCamera(LookingAt({2.4, 0.4, 1.1}, {0, 0, 0}, {44, 44}, 0.75)),
                           BallCamera(LookingAt({-1.0, 2.3, 0.6}, {0.5, 0.3, 0}, {40, 40}, 0.15)),
                           BallCamera(LookingAt({-0.3, -0.2, 2.6}, {0, 0, 0}, {44, 44}, 0.75))},
                          0.12,
                          0.03};
};

TEST_F(SoundClearances, PlanesOfPossibleSpaceAreMetByAnyMoreAndSoundIsNot) {
  const std::vector<ConfigurationNumber> all = SphereWorld::Configurations();
  int finite = 0;
  for (int scene = 0; scene < 6 || finite == 0; ++scene) {
    ASSERT_LT(scene, 100) << "no configuration had room for a clearance";
    const ConfigurationNumber present = all[static_cast<size_t>(AnyOf(0, 399))];
    std::uniform_real_distribution<double> place(-0.8, 0.8);
    const Balls obstacles{{{place(random), place(random), 0.5 * place(random)}, 0.15}};
    if (Touch(SphereWorld::Arm(present), obstacles)) continue;
    const ObstacleImages images = world.See(obstacles, present);
    const PossibleSpace possible(world.space, images, world.Body(present));
    const DistanceImages distances = DistancesTo(ObstaclePlanes(images));
    const int min_views = AnyOf(2, 3);
    const TestSupport support{.possible_space = &possible};
    for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      const Policy policy{.preset = preset, .min_views = min_views};
      const CollisionChecker test(world.table, images, policy, support);
      const ClearanceMeter meter(test, images, policy, support, distances);
      for (int i = 0; i < 60; ++i) {
        const ConfigurationNumber number = all[static_cast<size_t>(AnyOf(0, 399))];
        const Verdict verdict = test.Check(number);
        const double clearance = *meter.Measure(SphereWorld::Grid().At(number), verdict);
        if (!verdict.free()) {
          EXPECT_EQ(clearance, 0);
          continue;
        }
        const GrownRobot robot(world.table, number, std::min(clearance, kBeyondAnyImage));
        const bool planes_meet = possible.PlanesMeet(robot.words, min_views);
        const bool sound = preset == Preset::kSound;
        EXPECT_FALSE(planes_meet && (!sound || possible.VoxelsMeet(robot.words, min_views)));
        if (sound) continue;
        if (clearance == kClearanceInfinity) continue;
        ++finite;
        const GrownRobot larger(world.table, number, clearance + kLittle);
        EXPECT_TRUE(possible.PlanesMeet(larger.words, min_views)) << clearance;
        const GrownRobot as_it_is(world.table, number, 0);
        for (const double level : {0.0, clearance, clearance + kLittle, 1.0 * AnyOf(1, 9)}) {
          EXPECT_EQ(std::any_of(possible.parts().begin(), possible.parts().end(),
                                [&](const PossibleSpace::Part& part) {
                                  return ClearanceMeets(part, level, as_it_is, min_views);
                                }),
                    clearance < level);
        }
      }
    }
  }
}

}  // namespace
}  // namespace silhouette
