// SPDX-License-Identifier: Apache-2.0
#include "capture/session/capture_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "tests/capture/session/fake_cell.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using Kind = CaptureSelection::Kind;

// Stores records: an excluded one, or one with empty masks.
void Put(Database& database, const std::vector<ConfigurationNumber>& numbers, bool excluded) {
  auto writer = database.Write("test");
  ASSERT_TRUE(writer.ok());
  for (const ConfigurationNumber number : numbers) {
    RobotImage image;
    image.number = number;
    image.excluded = excluded;
    if (!excluded) {
      for (const MaskSize size : database.mask_sizes()) image.masks.emplace_back(size);
    }
    ASSERT_TRUE(writer->Put(image).ok());
  }
  ASSERT_TRUE(writer->Commit().ok());
}

TEST(PlanCapture, EmptyDatabaseLacksEverythingInTheOrderOfTravel) {
  FakeCell cell;
  const auto plan = cell.Plan();
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->captures, cell.travel->Serpentine());
  EXPECT_TRUE(plan->exclusions.empty());
  EXPECT_EQ(plan->kept, 0u);
}

TEST(PlanCapture, MissingIsWhatHasNoRobotImage) {
  FakeCell cell;
  const auto all = cell.travel->Serpentine();
  Put(*cell.database, {all[3], all[7]}, /*excluded=*/false);
  Put(*cell.database, {all[5]}, /*excluded=*/true);  // in a region that is forbidden no longer
  const auto plan = cell.Plan();
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->captures.size(), all.size() - 2);
  EXPECT_EQ(plan->captures[5 - 1], all[5]);
  EXPECT_EQ(plan->kept, 2u);
}

TEST(PlanCapture, OfAnEmptyDatabaseNothingIsKept) {
  FakeCell cell;
  const auto plan = cell.Plan({.kind = Kind::kNothing});
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_TRUE(plan->captures.empty());
  EXPECT_EQ(plan->kept, 0u);
}

TEST(PlanCapture, ListedAreTakenAnewBesidesTheMissing) {
  FakeCell cell;
  const auto all = cell.travel->Serpentine();
  Put(*cell.database, all, /*excluded=*/false);
  const auto plan = cell.Plan({.kind = Kind::kListed, .listed = {all[9], all[2]}});
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_THAT(plan->captures, ElementsAre(all[2], all[9]));
  EXPECT_EQ(cell.Plan({.kind = Kind::kAll})->captures, all);
  const auto wrong =
      cell.Plan({.kind = Kind::kListed, .listed = {cell.database->grid().number_limit()}});
  EXPECT_TRUE(absl::IsInvalidArgument(wrong.status()));
}

TEST(PlanCapture, ForbiddenConfigurationsAreExcludedOnce) {
  CaptureSettings settings = QuickSettings();
  settings.forbidden_regions = {Region("corner", {{"turn", 0.5, 1}, {"lift", 0.2, 1}})};
  FakeCell cell(FakeDescription(), settings);
  const auto plan = cell.Plan();
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->captures.size() + plan->exclusions.size(), 30u);
  EXPECT_EQ(plan->exclusions.size(), 2u * 3u);  // turn 0.6 and 1; lift 0.25, 0.375, 0.5
  Put(*cell.database, plan->exclusions, /*excluded=*/true);
  EXPECT_TRUE(cell.Plan()->exclusions.empty());
  EXPECT_EQ(cell.Plan()->kept, 6u);
}

TEST(PlanCapture, RobotImagesInAForbiddenRegionAreNotLostUnasked) {
  CaptureSettings settings = QuickSettings();
  settings.forbidden_regions = {Region("corner", {{"turn", 0.5, 1}, {"lift", 0.2, 1}})};
  FakeCell cell(FakeDescription(), settings);
  Put(*cell.database, cell.travel->Serpentine(), /*excluded=*/false);
  const auto plan = cell.Plan();
  EXPECT_TRUE(absl::IsFailedPrecondition(plan.status()));
  EXPECT_THAT(plan.status().message(), HasSubstr("6 configurations"));
  EXPECT_THAT(plan.status().message(), HasSubstr("'corner'"));
  EXPECT_EQ(cell.Plan({.exclude_captured = true})->exclusions.size(), 6u);
}

TEST(PlanCapture, DurationIsTravelSettlingAndImages) {
  CaptureSettings settings = QuickSettings();
  settings.settle = absl::Seconds(2);
  settings.joint_speed = 0.1;
  FakeCell cell(FakeDescription(), settings);
  // 24 steps of lift (0.125), 5 of turn (0.4), at 0.1 per second.
  const absl::Duration travel = absl::Seconds((24 * 0.125 + 5 * 0.4) / 0.1);
  const absl::Duration rest = cell.Plan()->duration - travel - 30 * settings.settle;
  EXPECT_GT(rest, absl::ZeroDuration());
  EXPECT_LT(rest, absl::Seconds(5));
}

TEST(PlanCapture, DurationCountsAllSetsOfStillImages) {
  std::vector<absl::Duration> durations;
  for (const int sets : {1, 2, 3}) {
    CaptureSettings settings = QuickSettings();
    settings.still_images = sets;
    durations.push_back(FakeCell(FakeDescription(), settings).Plan()->duration);
  }
  EXPECT_GT(durations[1], durations[0]);
  EXPECT_EQ(durations[2] - durations[1], durations[1] - durations[0]);
}

TEST(PlanCapture, RoomOnDiskSuffices) {
  FakeCell cell(FakeDescription(40, 30));
  cell.TakeReferences();
  const uint64_t before = cell.database->GetUsage()->used_bytes;
  const uint64_t bytes = cell.Plan()->bytes;
  ASSERT_TRUE(cell.Capture().complete());
  const uint64_t grown = cell.database->GetUsage()->used_bytes - before;
  EXPECT_LE(grown, bytes);
  EXPECT_GE(grown * 10, bytes);
}

}  // namespace
}  // namespace silhouette
