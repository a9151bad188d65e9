// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/explanation.h"

#include <gtest/gtest.h>

#include <set>

namespace silhouette::cell_experiment {
namespace {

constexpr Policy kUncalibrated{.preset = Preset::kUncalibrated};
constexpr Policy kPaper{.preset = Preset::kPaper, .min_views = 3};
constexpr Policy kCalibrated{.preset = Preset::kCalibrated};

constexpr PlaceInView kSeen{.plane = PlaceInView::kObstacle, .in_test_image = true};
constexpr PlaceInView kBehindRobot{
    .robot_in_line = true, .plane = PlaceInView::kUnknown, .in_test_image = true};
constexpr PlaceInView kLooksEmpty{.plane = PlaceInView::kBackground, .in_test_image = true};
constexpr PlaceInView kNotInTestImage{.plane = PlaceInView::kObstacle, .in_test_image = false};

PlaceInView CoveredFor(Cause cover) {
  return {.plane = PlaceInView::kUnknown, .in_test_image = true, .cover = cover};
}

Cause CauseOf(const std::vector<Place>& places, const Policy& policy, bool on_grid = true) {
  return FindCause(places, policy, on_grid).cause;
}

TEST(Cause, RobotOnEveryLineOfSightHides) {
  const Place hidden(3, kBehindRobot);
  for (const Policy& policy : {kUncalibrated, kPaper, kCalibrated}) {
    EXPECT_EQ(CauseOf({hidden}, policy), Cause::kHidden);
  }
}

TEST(Cause, ThresholdWithoutCalibrationAsksForMoreThanIsSeen) {
  const Place seen_once = {kSeen, kBehindRobot, kBehindRobot};
  const Place seen_twice = {kSeen, kBehindRobot, kSeen};
  EXPECT_EQ(CauseOf({seen_once}, kUncalibrated), Cause::kOccluded);
  EXPECT_EQ(CauseOf({seen_twice}, kPaper), Cause::kOccluded);
  // One view is enough for the calibrated test, two for two of three: nothing explains a miss.
  EXPECT_EQ(CauseOf({seen_once}, kCalibrated), Cause::kUnexplained);
  EXPECT_EQ(CauseOf({seen_twice}, kUncalibrated), Cause::kUnexplained);
}

TEST(Cause, OneOpenPlaceMakesTheOthersNoExcuse) {
  const Place hidden(2, kBehindRobot);
  const Place faint = {kSeen, kLooksEmpty};
  const CauseFound found = FindCause(std::vector<Place>{hidden, faint}, kCalibrated, true);
  EXPECT_EQ(found.cause, Cause::kContrast);
  EXPECT_EQ(found.place, 1u);
  EXPECT_EQ(found.view, 1u);
}

TEST(Cause, PlaceWithTheFewestFaultsIsTheOneThatSpeaks) {
  const Place two_faults = {kLooksEmpty, kLooksEmpty, kSeen};
  const Place one_fault = {kSeen, CoveredFor(Cause::kRim), kSeen};
  EXPECT_EQ(CauseOf({two_faults, one_fault}, kUncalibrated), Cause::kRim);
  EXPECT_EQ(CauseOf({one_fault, two_faults}, kUncalibrated), Cause::kRim);
}

TEST(Cause, CoverWithoutTheRobotIsToldAsWhatItIs) {
  for (const Cause cover : {Cause::kRim, Cause::kRobotCell, Cause::kShadow, Cause::kGrown}) {
    EXPECT_EQ(CauseOf({{CoveredFor(cover), kBehindRobot}}, kCalibrated), cover);
  }
}

TEST(Cause, TestImageThatLacksThePlaceIsBlamedOnTheGridOnlyOffTheGrid) {
  EXPECT_EQ(CauseOf({{kNotInTestImage, kSeen}}, kCalibrated, true), Cause::kRobotImage);
  EXPECT_EQ(CauseOf({{kNotInTestImage, kSeen}}, kCalibrated, false), Cause::kTestCell);
}

TEST(Cause, SoundPresetMissesWhatIsSmallerThanTheLeastObstacle) {
  constexpr Policy kSound{.preset = Preset::kSound};
  EXPECT_EQ(CauseOf({Place(3, kBehindRobot)}, kSound), Cause::kSize);
  EXPECT_EQ(CauseOf({{kSeen, kLooksEmpty, kSeen}}, kSound), Cause::kContrast);
  EXPECT_EQ(CauseOf({{kNotInTestImage, kSeen, kSeen}}, kSound), Cause::kRobotImage);
}

TEST(Cause, NamesAreDistinct) {
  std::set<std::string> names;
  for (size_t i = 0; i < kCauses; ++i) names.insert(NameOf(static_cast<Cause>(i)));
  EXPECT_EQ(names.size(), kCauses);
  EXPECT_EQ(names.count(""), 0u);
}

}  // namespace
}  // namespace silhouette::cell_experiment
