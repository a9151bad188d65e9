// SPDX-License-Identifier: Apache-2.0
#include "capture/session/travel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <stdexcept>

#include "tests/random.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

std::string Name(int j) { return "joint_" + std::to_string(j); }

ConfigurationGrid RandomGrid(std::mt19937_64& random, int most_joints, int most_steps) {
  std::vector<GridJoint> joints;
  const int count = 1 + static_cast<int>(random() % uint64_t(most_joints));
  for (int j = 0; j < count; ++j) {
    GridJoint joint{.name = Name(j), .lower = -1, .upper = 0.5 + static_cast<double>(j)};
    joint.steps = 2 + static_cast<int>(random() % uint64_t(most_steps - 1));
    if (random() % 4 == 0 && joint.steps >= 3) {
      joint.continuous = true;
      joint.upper = joint.lower + 2 * std::numbers::pi;
    } else if (random() % 8 == 0) {
      joint.steps = 1;
      joint.upper = joint.lower;
    }
    joints.push_back(joint);
  }
  return ConfigurationGrid(joints);
}

std::vector<ForbiddenRegion> RandomRegions(const ConfigurationGrid& grid, std::mt19937_64& random) {
  std::vector<ForbiddenRegion> regions;
  std::uniform_real_distribution<double> share(0, 1);
  for (uint64_t r = random() % 4; r > 0; --r) {
    ForbiddenRegion region{.name = "region " + std::to_string(r), .ranges = {}};
    for (const GridJoint& joint : grid.joints()) {
      if (random() % 3 == 0 && !region.ranges.empty()) continue;
      const double span = joint.upper - joint.lower;
      const double lower = joint.lower + span * share(random);
      region.ranges.push_back({joint.name, lower, lower + 0.3 * span * share(random)});
    }
    regions.push_back(region);
  }
  return regions;
}

// Samples of all that the robot may pass on a move, joints keeping step or not.
bool MayTouch(const ConfigurationGrid& grid, const std::vector<ForbiddenRegion>& regions,
              const Configuration& from, const Configuration& to, std::mt19937_64& random) {
  std::uniform_real_distribution<double> share(0, 1);
  for (int sample = 0; sample < 60; ++sample) {
    for (const ForbiddenRegion& region : regions) {
      bool inside = true;
      for (size_t j = 0; j < from.size(); ++j) {
        const double value = from[j] + share(random) * (to[j] - from[j]);
        for (const ForbiddenRegion::Range& range : region.ranges) {
          if (range.joint != grid.joints()[j].name) continue;
          double turned = value;
          if (grid.joints()[j].continuous) {
            turned = range.lower +
                     std::fmod(value - range.lower + 8 * std::numbers::pi, 2 * std::numbers::pi);
          }
          inside &= turned >= range.lower && turned <= range.upper;
        }
      }
      if (inside) return true;
    }
  }
  return false;
}

TEST(Travel, SerpentineVisitsEveryConfigurationOnceStepByStep) {
  Random random;
  for (int round = 0; round < 50; ++round) {
    const ConfigurationGrid grid = RandomGrid(random, 4, 9);
    const std::vector<ConfigurationNumber> order = Travel(grid, {}).Serpentine();
    ASSERT_EQ(order.size(), grid.size());
    EXPECT_EQ(std::set<ConfigurationNumber>(order.begin(), order.end()).size(), grid.size());
    for (size_t i = 1; i < order.size(); ++i) {
      const GridIndex a = grid.IndexOf(order[i - 1]).value();
      const GridIndex b = grid.IndexOf(order[i]).value();
      int steps = 0;
      for (size_t j = 0; j < a.size(); ++j) steps += std::abs(a[j] - b[j]);
      ASSERT_EQ(steps, 1);
    }
  }
}

TEST(Travel, JointWithTheSmallestStepsRunsFastest) {
  const ConfigurationGrid grid({{.name = "fine", .lower = 0, .upper = 1, .steps = 11},
                                {.name = "coarse", .lower = 0, .upper = 1, .steps = 3}});
  const std::vector<ConfigurationNumber> order = Travel(grid, {}).Serpentine();
  EXPECT_EQ(grid.At(order[10]), (Configuration{1, 0}));
  EXPECT_EQ(grid.At(order[11]), (Configuration{1, 0.5}));
  EXPECT_EQ(grid.At(order[21]), (Configuration{0, 0.5}));
}

TEST(Travel, RoutesNeverTouchARegion) {
  Random random;
  int around = 0;
  for (int round = 0; round < 60; ++round) {
    const ConfigurationGrid grid = RandomGrid(random, 3, 8);
    const std::vector<ForbiddenRegion> regions = RandomRegions(grid, random);
    const Travel travel(grid, regions);
    const std::vector<ConfigurationNumber> all = travel.Serpentine();
    for (int i = 0; i < 40; ++i) {
      const ConfigurationNumber from = all[random() % all.size()];
      const ConfigurationNumber to = all[random() % all.size()];
      if (travel.Forbidden(from)) continue;
      const auto route = travel.Route(from, to);
      if (!route.ok()) {
        EXPECT_TRUE(travel.Forbidden(to) || travel.parts() > 1) << route.status();
        continue;
      }
      ASSERT_FALSE(travel.Forbidden(to));
      ASSERT_EQ(route->back(), grid.At(to));
      Configuration here = grid.At(from);
      for (const Configuration& next : *route) {
        ASSERT_FALSE(MayTouch(grid, regions, here, next, random));
        here = next;
      }
      if (route->size() > 1) ++around;
    }
  }
  EXPECT_GT(around, 20);
}

// A wall across the first joint, with a gap at the upper end of the second.
ConfigurationGrid Square() {
  return ConfigurationGrid({{.name = "a", .lower = 0, .upper = 10, .steps = 11},
                            {.name = "b", .lower = 0, .upper = 10, .steps = 11}});
}
std::vector<ForbiddenRegion> TravelWall(double lower, double upper, double height) {
  return {{.name = "wall", .ranges = {{"a", lower, upper}, {"b", -1, height}}}};
}

TEST(Travel, GoesAroundThroughAGapWithFewMoves) {
  const ConfigurationGrid grid = Square();
  const Travel travel(grid, TravelWall(4.5, 6.5, 8.5));
  EXPECT_EQ(travel.parts(), 1);
  const auto route = travel.Route(grid.NumberOf({0, 0}), grid.NumberOf({10, 0}));
  ASSERT_TRUE(route.ok()) << route.status();
  EXPECT_LE(route->size(), 4u);
  EXPECT_EQ(route->back(), (Configuration{10, 0}));
}

TEST(Travel, RegionBetweenTwoGridValuesIsNotCrossed) {
  const ConfigurationGrid grid = Square();
  const Travel travel(grid, TravelWall(4.4, 4.6, 20));
  EXPECT_EQ(travel.parts(), 2);
  EXPECT_FALSE(travel.Forbidden(grid.NumberOf({4, 3})));
  const auto route = travel.Route(grid.NumberOf({4, 3}), grid.NumberOf({5, 3}));
  EXPECT_TRUE(absl::IsFailedPrecondition(route.status()));
  EXPECT_THAT(route.status().message(), HasSubstr("no way around the forbidden region 'wall'"));
}

TEST(Travel, FromAnywhereTheRouteEntersTheGridSafely) {
  const ConfigurationGrid grid = Square();
  const std::vector<ForbiddenRegion> regions = TravelWall(4.5, 6.5, 8.5);
  const Travel travel(grid, regions);
  std::mt19937_64 random(1);
  const Configuration start = {3.3, -2};  // outside the grid
  const auto route = travel.RouteFrom(start, grid.NumberOf({9, 1}));
  ASSERT_TRUE(route.ok()) << route.status();
  EXPECT_EQ(route->back(), (Configuration{9, 1}));
  Configuration here = start;
  for (const Configuration& next : *route) {
    EXPECT_FALSE(MayTouch(grid, regions, here, next, random));
    here = next;
  }
}

TEST(Travel, RobotInsideARegionIsNotMoved) {
  const ConfigurationGrid grid = Square();
  const Travel travel(grid, TravelWall(4.5, 6.5, 8.5));
  const auto route = travel.RouteFrom({5, 5}, grid.NumberOf({9, 1}));
  EXPECT_THAT(route.status().message(), HasSubstr("stands in the forbidden region 'wall'"));
}

TEST(Travel, ForbiddenTargetHasNoRoute) {
  const ConfigurationGrid grid = Square();
  const Travel travel(grid, TravelWall(4.5, 6.5, 8.5));
  EXPECT_FALSE(travel.Route(grid.NumberOf({0, 0}), grid.NumberOf({5, 0})).ok());
  EXPECT_FALSE(travel.RouteFrom({0, 0}, grid.NumberOf({5, 0})).ok());
}

TEST(Travel, ContinuousJointIsNotDrivenAcrossTheEndOfItsRange) {
  const double pi = std::numbers::pi;
  const ConfigurationGrid grid(
      {{.name = "a", .lower = -pi, .upper = pi, .steps = 12, .continuous = true}});
  const std::vector<ForbiddenRegion> regions = {{.name = "front", .ranges = {{"a", -0.1, 0.1}}}};
  const Travel travel(grid, regions);
  EXPECT_EQ(travel.parts(), 2);
  EXPECT_FALSE(travel.Route(grid.NumberOf({0}), grid.NumberOf({11})).ok());
}

TEST(Travel, HugeGridIsRefused) {
  std::vector<GridJoint> joints;
  for (int j = 0; j < 5; ++j) {
    joints.push_back({.name = Name(j), .lower = 0, .upper = 1, .steps = 100});
  }
  EXPECT_THROW(Travel(ConfigurationGrid(joints), {}), std::invalid_argument);
}

TEST(TravelTime, IsThatOfTheJointWithTheLongestWay) {
  const Configuration from = {0, 1, 0};
  const Configuration to = {1, -2, 0.5};
  EXPECT_EQ(TravelTime(from, to, 0.5), absl::Seconds(6));
}

}  // namespace
}  // namespace silhouette
