// SPDX-License-Identifier: Apache-2.0
// The file of the newest check of the calibration, as the server follows it.
#include "server/live/calibration_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>

#include "calib/files/calibration_check_file.h"
#include "common/picture/files.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

class CalibrationWatchTest : public testing::Test {
 protected:
  const absl::Time now_ = absl::FromUnixSeconds(1'000'000);
  const Moment moment_{now_, absl::Seconds(500)};
  const CalibrationWatchSettings settings_{.file = (FreshFolder() / "check.json").string(),
                                           .max_age = absl::Hours(1)};

  void Write(absl::Time time, double moved) const {
    const CalibrationCheck check{.time = time,
                                 .calibration = "0123456789abcdef",
                                 .limit_mask_px = 0.2,
                                 .views = {{.name = "top",
                                            .method = "tags",
                                            .checked = true,
                                            .moved_px = 10 * moved,
                                            .moved_mask_px = moved,
                                            .holds = moved <= 0.2,
                                            .message = ""}}};
    ASSERT_TRUE(WriteWholeFile(settings_.file, CheckFileText(check)).ok());
  }
  CalibrationTrust Read() const { return ReadTrust(settings_, moment_); }
};

TEST_F(CalibrationWatchTest, AGoodCheckHoldsUntilItIsTooOld) {
  Write(now_ - absl::Minutes(20), 0.1);
  const CalibrationTrust trust = Read();
  EXPECT_TRUE(trust.holds);
  EXPECT_EQ(trust.fingerprint, "0123456789abcdef");
  EXPECT_EQ(trust.until, absl::Seconds(500) + absl::Minutes(40));
  EXPECT_EQ(trust.max_age, absl::Hours(1));
  EXPECT_EQ(trust.views, std::vector<std::string>{"top"});
  EXPECT_EQ(trust.limit, 0.2);
}

TEST_F(CalibrationWatchTest, AnOldOneIsOverAtOnce) {
  Write(now_ - absl::Hours(2), 0.1);
  EXPECT_LT(Read().until, moment_.running);
}

TEST_F(CalibrationWatchTest, ACameraThatMovedDoesNotHold) {
  Write(now_, 0.3);
  EXPECT_FALSE(Read().holds);
  EXPECT_THAT(Read().message, HasSubstr("view 'top' moved by 3.00 px (0.30 mask px)"));
}

TEST_F(CalibrationWatchTest, WhatCannotBeReadDoesNotHold) {
  EXPECT_FALSE(Read().holds);
  EXPECT_THAT(Read().message, HasSubstr("check.json"));
  ASSERT_TRUE(WriteWholeFile(settings_.file, "{\"holds\": true}").ok());
  EXPECT_FALSE(Read().holds);
  Write(now_ + absl::Hours(1), 0.1);
  EXPECT_FALSE(Read().holds);
  EXPECT_THAT(Read().message, HasSubstr("from the future"));
}

TEST_F(CalibrationWatchTest, ChangesAreTold) {
  Write(now_, 0.1);
  std::mutex mutex;
  std::condition_variable told;
  std::vector<bool> holds;
  CalibrationWatch watch(
      settings_, [&] { return moment_; },
      [&](std::shared_ptr<const CalibrationTrust> trust) {
        const std::lock_guard lock(mutex);
        holds.push_back(trust->holds);
        told.notify_all();
      });
  std::unique_lock lock(mutex);
  ASSERT_EQ(holds, std::vector<bool>{true});  // at once
  Write(now_, 0.3);
  ASSERT_TRUE(told.wait_for(lock, std::chrono::seconds(60), [&] { return holds.back() == false; }));
  std::filesystem::remove(settings_.file);
  const size_t count = holds.size();
  ASSERT_TRUE(told.wait_for(lock, std::chrono::seconds(60), [&] { return holds.size() > count; }));
  EXPECT_FALSE(holds.back());
}

TEST_F(CalibrationWatchTest, AClockThatIsSetRightEndsTheCheckEarlier) {
  Write(now_ - absl::Minutes(30), 0.1);
  std::mutex mutex;
  std::condition_variable told;
  absl::Duration behind = absl::Minutes(20);
  absl::Duration until;
  CalibrationWatch watch(
      settings_,
      [&] {
        const std::lock_guard lock(mutex);
        return Moment{now_ - behind, moment_.running};
      },
      [&](std::shared_ptr<const CalibrationTrust> trust) {
        const std::lock_guard lock(mutex);
        until = trust->until;
        told.notify_all();
      });
  std::unique_lock lock(mutex);
  ASSERT_EQ(until, moment_.running + absl::Minutes(50));
  behind = absl::ZeroDuration();
  EXPECT_TRUE(told.wait_for(lock, std::chrono::seconds(60),
                            [&] { return until == moment_.running + absl::Minutes(30); }));
}

}  // namespace
}  // namespace silhouette
