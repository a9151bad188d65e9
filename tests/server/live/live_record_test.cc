// SPDX-License-Identifier: Apache-2.0
#include "server/live/live_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

struct LiveRecordTest : ::testing::Test {
  Moment now{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};
  LiveRecord record{{"left", "right"}, absl::Seconds(1), [this] { return now; }};

  void Pass(absl::Duration time) {
    now.time += time;
    now.running += time;
  }
  void AllGood() {
    record.NoteImage(0, now, now);
    record.NoteImage(1, now, now);
    record.NoteJoints(now);
  }
};

TEST_F(LiveRecordTest, NothingServesBeforeItGaveAnything) {
  const LiveStatus status = record.Status();
  EXPECT_FALSE(status.serving);
  EXPECT_FALSE(status.cameras[0].serving);
  EXPECT_FALSE(status.robot.serving);
  EXPECT_EQ(status.cameras[0].age, std::nullopt);
}

TEST_F(LiveRecordTest, AllServeWhileTheirNewestIsYoungEnough) {
  AllGood();
  EXPECT_TRUE(record.Status().serving);
  Pass(absl::Seconds(1));
  EXPECT_TRUE(record.Status().serving);
  Pass(absl::Milliseconds(1));
  EXPECT_FALSE(record.Status().serving);
}

TEST_F(LiveRecordTest, OneCameraThatStoppedEndsServingOfTheWhole) {
  AllGood();
  Pass(absl::Seconds(2));
  record.NoteImage(0, now, now);
  record.NoteImageError(1, absl::UnavailableError("unplugged"));
  record.NoteJoints(now);
  const LiveStatus status = record.Status();
  EXPECT_FALSE(status.serving);
  EXPECT_TRUE(status.cameras[0].serving);
  EXPECT_FALSE(status.cameras[1].serving);
  EXPECT_EQ(status.cameras[1].errors, 1u);
  EXPECT_EQ(status.cameras[1].fault, "unplugged");
  EXPECT_EQ(status.cameras[1].age, absl::Seconds(2));
  EXPECT_THAT(Spoken(status), AllOf(HasSubstr("camera 'right' does not serve: unplugged")));
}

TEST_F(LiveRecordTest, RobotThatIsSilentEndsServing) {
  AllGood();
  Pass(absl::Seconds(2));
  record.NoteImage(0, now, now);
  record.NoteImage(1, now, now);
  EXPECT_FALSE(record.Status().robot.serving);
  EXPECT_FALSE(record.Status().serving);
}

TEST_F(LiveRecordTest, FaultGoesWithTheNextGoodImageAndTheErrorStays) {
  record.NoteImageError(0, absl::UnavailableError("unplugged"));
  AllGood();
  const DeviceStatus camera = record.Status().cameras[0];
  EXPECT_EQ(camera.fault, "");
  EXPECT_EQ(camera.last_error, "unplugged");
}

TEST_F(LiveRecordTest, AgeIsThatOfTheCaptureAndNotOfTheArrival) {
  record.NoteImage(0, MomentOf(now.time - absl::Milliseconds(800), now), now);
  EXPECT_TRUE(record.Status().cameras[0].serving);
  Pass(absl::Milliseconds(300));
  EXPECT_EQ(record.Status().cameras[0].age, absl::Milliseconds(1100));
  EXPECT_FALSE(record.Status().cameras[0].serving);
}

TEST_F(LiveRecordTest, StampAheadOfItsArrivalMakesNoImageYounger) {
  record.NoteImage(0, MomentOf(now.time + absl::Milliseconds(90), now), now);
  Pass(absl::Milliseconds(1050));
  EXPECT_EQ(record.Status().cameras[0].age, absl::Milliseconds(1050));
}

TEST_F(LiveRecordTest, SettingTheWallClockChangesNoAge) {
  record.NoteImage(0, now, now);
  now.time -= absl::Hours(1);
  now.running += absl::Seconds(2);
  EXPECT_EQ(record.Status().cameras[0].age, absl::Seconds(2));
}

TEST_F(LiveRecordTest, LatenciesCountFromTheArrival) {
  const Moment arrived = now;
  Pass(absl::Milliseconds(4));
  record.NoteMasks(arrived);
  record.NoteScene(arrived);
  Pass(absl::Milliseconds(3));
  record.NoteMap(arrived);
  const LiveStatus status = record.Status();
  EXPECT_EQ(status.to_masks.median, absl::Milliseconds(4));
  EXPECT_EQ(status.to_scene.median, absl::Milliseconds(4));
  EXPECT_EQ(status.to_map.median, absl::Milliseconds(7));
  EXPECT_THAT(Spoken(status), AllOf(HasSubstr("1 scene"), HasSubstr("median 7.0 ms")));
}

TEST_F(LiveRecordTest, LostSetsAreCountedWithTheirReason) {
  record.NoteLostSet(absl::UnavailableError("no image"));
  EXPECT_EQ(record.Status().lost_sets, 1u);
  EXPECT_EQ(record.Status().fault, "no image");
  record.NoteScene(now);
  EXPECT_EQ(record.Status().fault, "");
}

}  // namespace
}  // namespace silhouette
