// SPDX-License-Identifier: Apache-2.0
#include "capture/session/travel.h"

#include <gtest/gtest.h>

#include <numbers>
#include <stdexcept>

namespace silhouette {
namespace {

constexpr double kPi = std::numbers::pi;

ConfigurationGrid Grid() {
  return ConfigurationGrid(
      {{.name = "turn", .lower = -kPi, .upper = kPi, .steps = 36, .continuous = true},
       {.name = "lift", .lower = -1, .upper = 1, .steps = 21}});
}

ForbiddenRegions Regions(std::vector<ForbiddenRegion::Range> ranges) {
  return ForbiddenRegions(std::vector<ForbiddenRegion>{{.name = "wall", .ranges = ranges}}, Grid());
}

using Values = std::vector<double>;

TEST(ForbiddenRegions, HoldWhatIsWithinAllRangesBoundsIncluded) {
  const ForbiddenRegions regions = Regions({{"turn", 0, 0.5}, {"lift", -0.2, 0.3}});
  EXPECT_EQ(regions.At(Values{0.2, 0.1}), "wall");
  EXPECT_EQ(regions.At(Values{0.5, 0.3}), "wall");
  EXPECT_EQ(regions.At(Values{0, -0.2}), "wall");
  EXPECT_FALSE(regions.At(Values{0.51, 0.1}));
  EXPECT_FALSE(regions.At(Values{0.2, 0.31}));
}

TEST(ForbiddenRegions, JointThatIsNotNamedIsNotBounded) {
  const ForbiddenRegions regions = Regions({{"lift", 0.5, 2}});
  for (const double turn : {-3.0, 0.0, 3.0}) {
    EXPECT_TRUE(regions.At(Values{turn, 0.7}));
    EXPECT_FALSE(regions.At(Values{turn, 0.4}));
  }
}

TEST(ForbiddenRegions, EveryTurnOfAContinuousJointCounts) {
  const ForbiddenRegions regions = Regions({{"turn", 0.9 * kPi, 1.1 * kPi}});
  EXPECT_TRUE(regions.At(Values{-0.95 * kPi, 0}));
  EXPECT_TRUE(regions.At(Values{0.95 * kPi, 0}));
  EXPECT_TRUE(regions.At(Values{4.95 * kPi, 0}));
  EXPECT_FALSE(regions.At(Values{0.85 * kPi, 0}));
  EXPECT_FALSE(regions.At(Values{-0.85 * kPi, 0}));
  EXPECT_FALSE(regions.Between(Values{-0.85 * kPi, 0}, Values{0.85 * kPi, 0}));
}

TEST(ForbiddenRegions, MoveMayNotPassThroughWhateverTheJointsSpeeds) {
  const ForbiddenRegions regions = Regions({{"turn", 0.4, 0.6}, {"lift", -0.1, 0.1}});
  EXPECT_TRUE(regions.Between(Values{0, 0}, Values{1, 0}));
  // The straight line misses the region; a robot that moves its first joint faster does not.
  EXPECT_TRUE(regions.Between(Values{0, 0}, Values{0.5, 1}));
  EXPECT_FALSE(regions.Between(Values{0, 0.2}, Values{1, 0.9}));
}

TEST(ForbiddenRegions, WrongRegionsAreRefused) {
  EXPECT_THROW(Regions({{"elbow", 0, 1}}), std::invalid_argument);
  EXPECT_THROW(Regions({{"lift", 1, 0}}), std::invalid_argument);
  EXPECT_THROW(Regions({{"lift", 0, std::nan("")}}), std::invalid_argument);
  EXPECT_THROW(Regions({}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
