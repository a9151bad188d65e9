// SPDX-License-Identifier: Apache-2.0
#include "capture/session/reference_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "capture/session/history.h"
#include "tests/capture/session/fake_cell.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

TEST(ReferencesWithRobot, AreThoseOfTheEmptyCell) {
  FakeCell cell;
  cell.TakeReferences();
  const auto empty = ReadReferences(*cell.database).value();
  const auto taken = TakeReferencesWithRobot(*cell.database, *cell.travel, cell.robot, cell.rig,
                                             cell.settings, 30);
  ASSERT_TRUE(taken.ok()) << taken.status();
  EXPECT_TRUE(taken->views(0).with_robot());
  EXPECT_EQ(taken->views(0).images(), 30);
  ASSERT_TRUE(cell.database->SetReferences(*taken, "test").ok());
  const auto references = ReadReferences(*cell.database).value();
  for (size_t v = 0; v < references.size(); ++v) {
    EXPECT_EQ(references[v].Describe().undefined, 0) << v;
    EXPECT_EQ(cv::norm(references[v].mean(), empty[v].mean(), cv::NORM_INF), 0) << v;
  }
  // And the robot images that are captured with them are the same.
  EXPECT_TRUE(cell.Capture().status.ok());
}

TEST(ReferencesWithRobot, AreTakenWhereTheRobotStandsStill) {
  FakeCell cell;
  cell.settings.still_images = CaptureSettings{}.still_images;
  const auto taken = TakeReferencesWithRobot(*cell.database, *cell.travel, cell.robot, cell.rig,
                                             cell.settings, 10);
  ASSERT_TRUE(taken.ok()) << taken.status();
  EXPECT_EQ(cell.rig.grabs, 20u);
}

TEST(ReferencesWithRobot, RobotImagesTellWhereTheRobotIs) {
  FakeCell cell;
  cell.TakeReferences();
  ASSERT_TRUE(cell.Capture().status.ok());
  const auto empty = ReadReferences(*cell.database).value();
  const auto taken = TakeReferencesWithRobot(*cell.database, *cell.travel, cell.robot, cell.rig,
                                             cell.settings, 12);
  ASSERT_TRUE(taken.ok()) << taken.status();
  for (int v = 0; v < taken->views_size(); ++v) {
    const auto reference =
        Reference::FromPng(taken->views(v).mean_png(), taken->views(v).noise_png()).value();
    cv::Mat unlike = reference.mean() != empty[static_cast<size_t>(v)].mean();
    if (!reference.undefined().empty()) unlike.setTo(0, reference.undefined());
    EXPECT_EQ(cv::countNonZero(unlike), 0) << v;
  }
}

TEST(ReferencesWithRobot, RobotImagesOfACellThatMayHaveChangedAreNotUsed) {
  FakeCell cell;
  cell.TakeReferences();
  ASSERT_TRUE(cell.Capture().complete());
  // They have the robot everywhere.
  auto writer = cell.database->Write("test");
  for (auto [number, image] : cell.Content()) {
    image.captured = absl::Now();
    for (Mask& mask : image.masks) {
      mask = Mask::FromPredicate(mask.size(), [](int, int) { return true; });
    }
    ASSERT_TRUE(writer->Put(image, /*replace=*/true).ok());
  }
  ASSERT_TRUE(writer->Commit().ok());
  const auto undefined_with = [&](const storage::v1::CaptureHistory& history) {
    EXPECT_TRUE(cell.database->SetCaptureHistory(history).ok());
    const auto taken = TakeReferencesWithRobot(*cell.database, *cell.travel, cell.robot, cell.rig,
                                               cell.settings, 30);
    EXPECT_TRUE(taken.ok()) << taken.status();
    return ReferencesIn(*taken, cell.database->cell()).value()[0].Describe().undefined;
  };
  storage::v1::CaptureHistory suspect;
  SetTime(absl::Now(), *suspect.add_suspects()->mutable_until());
  EXPECT_EQ(undefined_with(suspect), 0);
  storage::v1::CaptureHistory checked;
  checked.add_checks()->set_alarm("view 'front' moved");
  EXPECT_EQ(undefined_with(checked), 0);
  checked.add_checks();
  EXPECT_GT(undefined_with(checked), 0) << "as it was";
}

TEST(ReferencesWithRobot, ConfigurationsAreSpreadAndNotForbidden) {
  const FakeCell cell;
  const std::vector<ForbiddenRegion> regions = {
      {.name = "left", .ranges = {{.joint = "turn", .lower = -1, .upper = -0.3}}}};
  const Travel travel(cell.travel->grid(), regions);
  const auto spread = SpreadConfigurations(travel, 10);
  ASSERT_EQ(spread.size(), 10u);
  EXPECT_EQ(std::set(spread.begin(), spread.end()).size(), 10u);
  for (const ConfigurationNumber number : spread) EXPECT_FALSE(travel.Forbidden(number));
  EXPECT_EQ(SpreadConfigurations(*cell.travel, 1000).size(), 30u);  // all there are
}

TEST(ReferencesWithRobot, TooFewConfigurationsAreRefused) {
  FakeCell cell;
  const auto taken =
      TakeReferencesWithRobot(*cell.database, *cell.travel, cell.robot, cell.rig, cell.settings, 4);
  EXPECT_THAT(taken.status().message(), HasSubstr("at least 5"));
}

TEST(ReferencesWithRobot, FailingRobotIsStopped) {
  FakeCell cell;
  cell.robot.on_move = [](size_t move) {
    return move == 3 ? absl::DeadlineExceededError("stuck") : absl::OkStatus();
  };
  cell.robot.on_stop = [] { return absl::UnavailableError("no answer"); };
  std::string said;
  CaptureObserver observer;
  observer.say = [&](const std::string& line) { said = line; };
  const auto taken = TakeReferencesWithRobot(*cell.database, *cell.travel, cell.robot, cell.rig,
                                             cell.settings, 10, observer);
  EXPECT_EQ(taken.status(), absl::DeadlineExceededError("stuck"));
  EXPECT_EQ(cell.robot.stops, 1);
  EXPECT_EQ(said, "the stop command to the robot failed: no answer");
}

TEST(ReferencesWithRobot, StopIsHeededBeforeTheNextMove) {
  FakeCell cell;
  CaptureObserver observer;
  observer.stop_requested = [&] { return cell.robot.moves.size() == 3; };
  const auto taken = TakeReferencesWithRobot(*cell.database, *cell.travel, cell.robot, cell.rig,
                                             cell.settings, 10, observer);
  EXPECT_EQ(taken.status(), absl::CancelledError("stopped; no reference images were stored"));
  EXPECT_EQ(cell.robot.moves.size(), 3u);
}

}  // namespace
}  // namespace silhouette
