// SPDX-License-Identifier: Apache-2.0
// A capture whose first images are not those of the robot ends before anything is stored.
#include "capture/session/first_look.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/capture/session/fake_cell.h"

namespace silhouette {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// The fake robot stays clear of the images' borders: it is cut only where `lift` is 0.
CaptureSettings Looking() {
  CaptureSettings settings = QuickSettings();
  settings.first_look = FirstLookSettings();
  settings.first_look.may_be_cut = true;
  settings.sentinels.count = 3;
  return settings;
}

class FirstLookTest : public testing::Test {
 protected:
  void ExpectRefused(const std::string& why) {
    const CaptureReport report = cell_.Capture();
    EXPECT_EQ(report.status.code(), absl::StatusCode::kFailedPrecondition) << report.status;
    EXPECT_THAT(std::string(report.status.message()), HasSubstr(why));
    EXPECT_EQ(report.captured, 0u);
    EXPECT_THAT(cell_.Content(), IsEmpty());
    EXPECT_GE(cell_.robot.stops, 1);
    EXPECT_LE(cell_.robot.moves.size(), 3u) << "at once";
  }

  FakeCell cell_{FakeDescription(), Looking()};
};

TEST_F(FirstLookTest, RobotThatIsSeenAndMovesIsCapturedAsWithoutIt) {
  cell_.TakeReferences();
  const CaptureReport report = cell_.Capture();
  ASSERT_TRUE(report.complete()) << report.status;
  FakeCell other;
  other.TakeReferences();
  ASSERT_TRUE(other.Capture().complete());
  EXPECT_EQ(cell_.Content(), other.Content());
}

TEST_F(FirstLookTest, RobotThatNoViewSeesEndsTheSession) {
  cell_.TakeReferences();
  cell_.rig.robot_present = false;
  ExpectRefused("no view sees the robot");
  cell_.rig.robot_present = true;
  EXPECT_TRUE(cell_.Capture().complete()) << "once it is mended, the same command goes on";
}

TEST_F(FirstLookTest, RobotThatTheBorderCutsEndsTheSessionUnlessItMay) {
  cell_.settings.first_look.may_be_cut = false;
  cell_.TakeReferences();
  ExpectRefused("the border of the image cuts the robot in ");
  cell_.settings.first_look.may_be_cut = true;
  EXPECT_TRUE(cell_.Capture().complete());
}

TEST_F(FirstLookTest, ImagesThatDoNotFollowTheRobotEndTheSession) {
  cell_.TakeReferences();
  std::vector<CameraImage> frozen;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>& images) {
    if (frozen.empty()) frozen = images;
    images = frozen;
    return absl::OkStatus();
  };
  ExpectRefused("as if the robot did not move");
}

TEST_F(FirstLookTest, RobotInTheReferenceImagesEndsTheSession) {
  // It stood apart from where it is now; there, the empty cell is foreground.
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>& images) {
    for (CameraImage& image : images) {
      for (int y = 40; y < 55; ++y) {
        for (int x = 20; x < 30; ++x) image.pixels[static_cast<size_t>(y * image.width + x)] = 220;
      }
    }
    return absl::OkStatus();
  };
  cell_.TakeReferences();
  cell_.rig.on_grab = nullptr;
  ExpectRefused("is always foreground and apart from the robot that moves");
}

TEST_F(FirstLookTest, ResumedSessionIsNotLookedAtAgain) {
  cell_.TakeReferences();
  uint64_t done = 0;
  CaptureObserver observer;
  observer.progress = [&](uint64_t now) { done = now; };
  observer.stop_requested = [&] { return done >= 5; };
  EXPECT_TRUE(cell_.Capture({}, observer).stopped);
  EXPECT_THAT(cell_.Content(), SizeIs(5));
  cell_.settings.first_look.may_be_cut = false;  // it would be found now
  cell_.settings.sentinels.count = 0;
  EXPECT_TRUE(cell_.Capture().complete());
}

}  // namespace
}  // namespace silhouette
