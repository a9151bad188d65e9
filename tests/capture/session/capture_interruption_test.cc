// SPDX-License-Identifier: Apache-2.0
// A capture that is interrupted and resumed holds what an uninterrupted one holds.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/statvfs.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/capture/session/fake_cell.h"

namespace silhouette {
namespace {

using testing::SizeIs;

CaptureSettings WithARegion() {
  CaptureSettings settings = QuickSettings();
  settings.forbidden_regions = {Region("corner", {{"turn", 0.5, 1}, {"lift", 0.3, 1}})};
  return settings;
}

std::map<ConfigurationNumber, RobotImage> Uninterrupted() {
  FakeCell cell(FakeDescription(), WithARegion());
  cell.TakeReferences();
  EXPECT_TRUE(cell.Capture().complete());
  return cell.Content();
}

TEST(InterruptedCapture, IsResumedAfterAStopAtAnyConfiguration) {
  const auto whole = Uninterrupted();
  ASSERT_THAT(whole, SizeIs(30));
  for (uint64_t stop = 0; stop <= 26; ++stop) {
    FakeCell cell(FakeDescription(), WithARegion());
    cell.TakeReferences();
    uint64_t done = 0;
    CaptureObserver observer;
    observer.progress = [&](uint64_t so_far) { done = so_far; };
    observer.stop_requested = [&] { return done == stop; };
    const CaptureReport first = cell.Capture({}, observer);
    EXPECT_TRUE(first.status.ok()) << first.status;
    EXPECT_EQ(first.stopped, stop < 26);
    EXPECT_EQ(first.captured, stop);
    EXPECT_EQ(first.excluded, 4u);
    EXPECT_THAT(cell.Content(), SizeIs(stop + 4));
    const CaptureReport second = cell.Capture();
    EXPECT_TRUE(second.complete()) << second.status;
    EXPECT_EQ(second.captured, 26 - stop);
    EXPECT_EQ(cell.Content(), whole);
  }
}

TEST(InterruptedCapture, IsResumedAfterALostDeviceAtAnyCall) {
  const auto whole = Uninterrupted();
  // A configuration takes four calls: every third comes to each kind of call.
  for (size_t lost = 1;; lost += 3) {
    FakeCell cell(FakeDescription(), WithARegion());
    cell.TakeReferences();
    size_t calls = 0;
    const auto fault = [&] {
      return ++calls == lost ? absl::InternalError("connection lost") : absl::OkStatus();
    };
    cell.robot.on_move = [&](size_t) { return fault(); };
    cell.robot.on_state = [&](RobotState&) { return fault(); };
    cell.rig.on_grab = [&](size_t, std::vector<CameraImage>&) { return fault(); };
    const CaptureReport first = cell.Capture();
    if (calls < lost) {
      EXPECT_TRUE(first.complete());
      EXPECT_GT(lost, 4 * 26u);
      break;
    }
    EXPECT_EQ(first.status.message(), "connection lost");
    EXPECT_LT(first.captured, 26u);
    EXPECT_THAT(cell.Content(), SizeIs(first.captured + first.excluded));
    const CaptureReport second = cell.Capture();
    EXPECT_TRUE(second.complete()) << second.status;
    EXPECT_EQ(cell.Content(), whole) << "lost at call " << lost;
  }
}

// A file system of a few megabytes; gone with the test.
class SmallDisk : public testing::Test {
 protected:
  void SetUp() override {
    disk_ = folder_ / "disk";
    std::filesystem::create_directories(disk_);
    if (mount("tmpfs", disk_.c_str(), "tmpfs", 0, "size=4m") != 0) {
      GTEST_SKIP() << "a tmpfs cannot be mounted here: " << strerror(errno);
    }
    mounted_ = true;
  }
  void TearDown() override {
    if (mounted_) umount2(disk_.c_str(), MNT_DETACH);
  }

  // Leaves about `bytes` of room.
  void FillUpTo(uint64_t bytes) {
    struct statvfs stat {};
    ASSERT_EQ(statvfs(disk_.c_str(), &stat), 0);
    const uint64_t available = stat.f_bavail * stat.f_bsize;
    ASSERT_GT(available, bytes);
    std::ofstream filler(disk_ + "/filler", std::ios::binary);
    filler << std::string(available - bytes, 'x');
  }
  void MakeRoom() { std::filesystem::remove(disk_ + "/filler"); }

  const std::filesystem::path folder_ = FreshFolder();
  std::string disk_;
  bool mounted_ = false;
};

TEST_F(SmallDisk, FullDiskEndsTheSessionAndNothingAcknowledgedIsLost) {
  const int turns = 60;
  const int lifts = 30;
  FakeCell whole(FakeDescription(turns, lifts));
  whole.TakeReferences();
  ASSERT_TRUE(whole.Capture().complete());

  CaptureSettings settings = QuickSettings();
  settings.commit_interval = absl::Milliseconds(20);
  FakeCell cell(FakeDescription(turns, lifts), settings, disk_ + "/db");
  cell.TakeReferences();
  FillUpTo(120'000);
  const CaptureReport first = cell.Capture();
  EXPECT_TRUE(absl::IsResourceExhausted(first.status)) << first.status;
  EXPECT_GT(first.captured, 0u);
  EXPECT_LT(first.captured, first.planned);
  EXPECT_THAT(cell.Content(), SizeIs(first.captured));

  MakeRoom();
  const CaptureReport second = cell.Capture();
  EXPECT_TRUE(second.complete()) << second.status;
  EXPECT_EQ(second.captured, second.planned);
  EXPECT_EQ(cell.Content(), whole.Content());
}

}  // namespace
}  // namespace silhouette
