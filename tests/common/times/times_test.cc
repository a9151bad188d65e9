// SPDX-License-Identifier: Apache-2.0
#include "common/times/times.h"

#include <gtest/gtest.h>

namespace silhouette {
namespace {

TEST(Times, AreReadAsPeopleWriteThem) {
  EXPECT_EQ(ParseTime("30"), absl::Seconds(30));
  EXPECT_EQ(ParseTime("30s"), absl::Seconds(30));
  EXPECT_EQ(ParseTime("20min"), absl::Minutes(20));
  EXPECT_EQ(ParseTime("1min30s"), absl::Seconds(90));
  EXPECT_EQ(ParseTime(" 1 min 30 s "), absl::Seconds(90));
  EXPECT_EQ(ParseTime("250 ms"), absl::Milliseconds(250));
  EXPECT_EQ(ParseTime(".5 h"), absl::Minutes(30));
  EXPECT_EQ(ParseTime("1e-2"), absl::Milliseconds(10));
  EXPECT_EQ(ParseTime("0"), absl::ZeroDuration());
}

TEST(Times, WhatCouldMeanSomethingElseIsNoTime) {
  for (const char* wrong : {"", " ", "s", "-1 s", "5 m", "1m30s", "1 min 30", "1,5 s", "inf", "nan",
                            "0x10", "1_000", "1e400 s", "1e300 h", "3 days", "1 s 2 x", "+1 s"}) {
    EXPECT_FALSE(ParseTime(wrong)) << wrong;
  }
}

TEST(Times, AreWrittenAsPeopleReadThem) {
  EXPECT_EQ(SpokenTime(absl::ZeroDuration()), "0 s");
  EXPECT_EQ(SpokenTime(absl::Milliseconds(250)), "250 ms");
  EXPECT_EQ(SpokenTime(absl::Nanoseconds(100)), "0.0001 ms");
  EXPECT_EQ(SpokenTime(absl::Seconds(1.5)), "1.5 s");
  EXPECT_EQ(SpokenTime(absl::Seconds(59.999)), "59.999 s");
  EXPECT_EQ(SpokenTime(absl::Seconds(60)), "1 min");
  EXPECT_EQ(SpokenTime(absl::Seconds(392.39)), "6 min 32 s");
  EXPECT_EQ(SpokenTime(absl::Seconds(3599.9)), "59 min 59 s");
  EXPECT_EQ(SpokenTime(absl::Hours(49) + absl::Seconds(70)), "49 h 1 min");
  EXPECT_EQ(SpokenTime(-absl::Seconds(2)), "-2 s");
  EXPECT_EQ(SpokenTime(absl::InfiniteDuration()), "infinitely long");
}

TEST(Times, LongerTimeNeverReadsLikeItsLimit) {
  EXPECT_EQ(SpokenTimeAbove(absl::Minutes(1), absl::Seconds(72)), "1 min 12 s");
  EXPECT_EQ(SpokenTimeAbove(absl::Minutes(1), absl::Seconds(60.3)), "61 s");
  EXPECT_EQ(SpokenTimeAbove(absl::Hours(2), absl::Hours(2) + absl::Seconds(30)), "7230 s");
  EXPECT_EQ(SpokenTimeAbove(absl::Seconds(1), absl::Seconds(1.2)), "1.2 s");
  EXPECT_EQ(SpokenTimeAbove(absl::Seconds(1), absl::Seconds(1.000004)), "1001 ms");
}

TEST(Times, WhatIsWrittenCanBeRead) {
  for (const double seconds : {0.0, 1e-4, 0.25, 1.5, 59.999, 60.0, 392.0, 7500.0}) {
    const absl::Duration time = absl::Seconds(seconds);
    EXPECT_EQ(ParseTime(SpokenTime(time)), time) << seconds;
  }
}

}  // namespace
}  // namespace silhouette
