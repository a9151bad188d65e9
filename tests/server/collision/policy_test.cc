// SPDX-License-Identifier: Apache-2.0
#include "server/collision/policy.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace silhouette {
namespace {

TEST(MinViews, PaperTakesAllViews) {
  for (int views = 1; views <= 8; ++views)
    EXPECT_EQ(MinViews({.preset = Preset::kPaper}, views), views);
}

TEST(MinViews, UncalibratedLetsOneViewBeOccludedByDefault) {
  EXPECT_EQ(MinViews({}, 1), 1);
  EXPECT_EQ(MinViews({}, 2), 1);
  EXPECT_EQ(MinViews({}, 4), 3);
}

TEST(MinViews, OfMoreThanFourViewsThreeThatShowAnObstacleAreEnough) {
  for (int views = 4; views <= 12; ++views) EXPECT_EQ(MinViews({}, views), 3);
  EXPECT_EQ(MinViews({.max_occluded_views = 1}, 8), 7);
}

TEST(MinViews, UncalibratedNeverFallsBelowOne) {
  EXPECT_EQ(MinViews({.max_occluded_views = 2}, 4), 2);
  EXPECT_EQ(MinViews({.max_occluded_views = 4}, 4), 1);
  EXPECT_EQ(MinViews({.max_occluded_views = 2147483647}, 4), 1);
}

TEST(MinViews, SaidDirectlyOverridesThePreset) {
  EXPECT_EQ(MinViews({.preset = Preset::kPaper, .min_views = 2}, 4), 2);
  EXPECT_EQ(MinViews({.min_views = 4}, 4), 4);
}

TEST(MinViews, PolicyThatCannotBeIsRefused) {
  EXPECT_THROW(MinViews({.min_views = 0}, 4), std::invalid_argument);
  EXPECT_THROW(MinViews({.min_views = 5}, 4), std::invalid_argument);
  EXPECT_THROW(MinViews({.max_occluded_views = -1}, 4), std::invalid_argument);
  EXPECT_THROW(MinViews({}, 0), std::invalid_argument);
}

TEST(MaxOccludedViews, OfManyViewsThreeThatSeeItAreEnough) {
  for (int views = 4; views <= 16; ++views) {
    EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound}, views), views - 3);
  }
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound}, 3), 1);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound}, 2), 1);
}

TEST(MaxOccludedViews, PermitsAtLeastWhatMinViewsDoes) {
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound}, 4), 1);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound, .max_occluded_views = 1}, 8), 1);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound, .min_views = 2}, 8), 6);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound, .max_occluded_views = 2}, 4), 2);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound, .max_occluded_views = 0}, 4), 0);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound, .min_views = 4}, 4), 1);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound, .min_views = 1}, 4), 3);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound, .max_occluded_views = 9}, 4), 3);
  EXPECT_EQ(MaxOccludedViews({.preset = Preset::kSound}, 1), 0);
  EXPECT_THROW(MaxOccludedViews({.max_occluded_views = -1}, 4), std::invalid_argument);
}

TEST(Preset, NamesLeadThereAndBack) {
  for (Preset preset : {Preset::kUncalibrated, Preset::kPaper}) {
    EXPECT_EQ(PresetFromName(NameOf(preset)), preset);
  }
  EXPECT_EQ(PresetFromName("Paper"), std::nullopt);
  EXPECT_EQ(PresetFromName(""), std::nullopt);
}

}  // namespace
}  // namespace silhouette
