// SPDX-License-Identifier: Apache-2.0
// The protective separation distance.
#include "server/collision/separation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace silhouette {
namespace {

SeparationSettings Levels() {
  SeparationSettings settings;
  settings.levels = {{"slow", 0.25, 0.1, 0.02}, {"fast", 1.5, 0.5, 0.4}};
  return settings;
}

TEST(ProtectiveDistance, AndTheWayToStopAreTheSumOfTheStandard) {
  SeparationSettings settings = Levels();
  settings.intrusion = 0.1;
  settings.uncertainty = 0.05;
  // 1.6 (0.3 + 0.5) + 0.15, and 1.5 * 0.3 + 0.4
  EXPECT_NEAR(ProtectiveDistance(settings, settings.levels[1], 0.2), 1.43, 1e-12);
  EXPECT_NEAR(WayToStop(settings, settings.levels[1], 0.2), 0.85, 1e-12);
}

TEST(ProtectiveDistance, PeopleReachFasterThanTheyWalkWhereTheyAreNear) {
  SeparationSettings settings = Levels();
  settings.reaction_time = 0.05;
  // 2.0 (0.1 + 0.1)
  EXPECT_NEAR(ProtectiveDistance(settings, settings.levels[0], 0.05), 0.4, 1e-12);
  // 2.0 * 0.26 is above 0.5; 1.6 * 0.26 is below.
  EXPECT_EQ(ProtectiveDistance(settings, settings.levels[0], 0.11), kNear);
}

TEST(ProtectiveDistance, NeverFallsAsAnImageGrowsOld) {
  const SeparationSettings settings = Levels();
  for (const SpeedLevel& level : settings.levels) {
    double before = 0;
    for (int i = 0; i < 1000; ++i) {
      const double distance = ProtectiveDistance(settings, level, i * 0.001);
      EXPECT_GE(distance, before);
      before = distance;
    }
  }
}

TEST(SeparationSettings, RefusesWhatCannotBe) {
  EXPECT_NO_THROW(RequireValid(Levels()));
  const auto refused = [](const auto& change) {
    SeparationSettings settings = Levels();
    change(settings);
    EXPECT_THROW(RequireValid(settings), std::invalid_argument);
  };
  refused([](SeparationSettings& s) { s.near_human_speed = 0.9 * s.human_speed; });
  refused([](SeparationSettings& s) { s.levels.clear(); });
  refused([](SeparationSettings& s) { s.levels[1].name = "slow"; });
  refused([](SeparationSettings& s) { s.levels[0].name.clear(); });
  refused([](SeparationSettings& s) { std::swap(s.levels[0], s.levels[1]); });
  refused([](SeparationSettings& s) { s.levels[0].speed = 0; });
  refused([](SeparationSettings& s) { s.levels[0].stopping_time = -1; });
  refused([](SeparationSettings& s) { s.human_speed = std::nan(""); });
  refused([](SeparationSettings& s) { s.uncertainty = -0.1; });
}

}  // namespace
}  // namespace silhouette
