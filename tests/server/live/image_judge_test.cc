// SPDX-License-Identifier: Apache-2.0
#include "server/live/image_judge.h"

#include <gtest/gtest.h>

#include <vector>

#include "server/live/helpers.h"
#include "server/live/live_record.h"

namespace silhouette {
namespace {

const absl::Time kStart = absl::FromUnixSeconds(1'000'000);

Moment ImageJudgeAt(absl::Duration passed) { return {kStart + passed, absl::Seconds(50) + passed}; }

storage::v1::CellDescription TwoViews() {
  storage::v1::CellDescription cell;
  for (const char* name : {"left", "right"}) {
    storage::v1::View& view = *cell.add_views();
    view.set_name(name);
    view.set_image_width(4);
    view.set_image_height(3);
  }
  return cell;
}

CameraImage ImageAt(absl::Duration passed, int channels = 1) {
  return {.width = 4,
          .height = 3,
          .channels = channels,
          .pixels = std::vector<uint8_t>(static_cast<size_t>(12 * channels)),
          .captured = kStart + passed};
}

struct ImageJudgeTest : ::testing::Test {
  ImageJudge judge{TwoViews(), absl::Seconds(1)};
  absl::StatusCode Judge(const CameraImage& image, absl::Duration arrived) {
    return judge.Judge(0, image, ImageJudgeAt(arrived), ImageJudgeAt(arrived)).status().code();
  }
};

TEST_F(ImageJudgeTest, GoodImagesPass) {
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(1)), absl::Seconds(1.1)), absl::StatusCode::kOk);
  EXPECT_TRUE(judge.TakeNews());
  EXPECT_FALSE(judge.TakeNews());
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(2), 3), absl::Seconds(2.1)), absl::StatusCode::kOk);
  EXPECT_TRUE(judge.TakeNews());
}

TEST_F(ImageJudgeTest, WhatIsNotTheCellsImageDoesNotPass) {
  CameraImage image = ImageAt(absl::Seconds(1));
  image.width = 3;
  EXPECT_EQ(Judge(image, absl::Seconds(1)), absl::StatusCode::kFailedPrecondition);
  image = ImageAt(absl::Seconds(1));
  image.pixels.pop_back();
  EXPECT_EQ(Judge(image, absl::Seconds(1)), absl::StatusCode::kInternal);
  image = ImageAt(absl::Seconds(1), 2);
  EXPECT_EQ(Judge(image, absl::Seconds(1)), absl::StatusCode::kInternal);
}

TEST_F(ImageJudgeTest, ImagesOfTheFutureOfLongAgoAndOutOfOrderDoNotPass) {
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(2)), absl::Seconds(1)), absl::StatusCode::kOutOfRange);
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(1)), absl::Seconds(2.1)),
            absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(3)), absl::Seconds(3)), absl::StatusCode::kOk);
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(2.9)), absl::Seconds(3)), absl::StatusCode::kAborted);
  const Moment now = ImageJudgeAt(absl::Seconds(3));
  EXPECT_TRUE(judge.Judge(1, ImageAt(absl::Seconds(2.9)), now, now).ok()) << "another view";
}

TEST_F(ImageJudgeTest, StampAheadOfItsArrivalRefusesNoLaterImage) {
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(1.09)), absl::Seconds(1)), absl::StatusCode::kOk);
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(1.04)), absl::Seconds(1.04)), absl::StatusCode::kOk);
  EXPECT_TRUE(judge.TakeNews());
}

TEST_F(ImageJudgeTest, TheSameImageAgainIsGoodButNoNews) {
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(1)), absl::Seconds(1)), absl::StatusCode::kOk);
  EXPECT_TRUE(judge.TakeNews());
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(1)), absl::Seconds(1.5)), absl::StatusCode::kOk);
  EXPECT_FALSE(judge.TakeNews());
}

TEST_F(ImageJudgeTest, WallClockThatIsSetBackMakesNoImageOld) {
  EXPECT_EQ(Judge(ImageAt(absl::Seconds(100)), absl::Seconds(100)), absl::StatusCode::kOk);
  const Moment set_back{kStart + absl::Seconds(41), absl::Seconds(50) + absl::Seconds(101)};
  EXPECT_TRUE(judge.Judge(0, ImageAt(absl::Seconds(41)), set_back, set_back).ok());
}

TEST_F(ImageJudgeTest, WallClockThatIsSetWhileAnImageComesMakesItNoYounger) {
  for (const double set : {-60.0, -5.0, -2.4, 2.4, 5.0, 60.0}) {
    ImageJudge of_step{TwoViews(), absl::Seconds(1)};
    const Moment asked = ImageJudgeAt(absl::Seconds(100));
    const auto judge_at = [&](double stamp, double arrived) {
      Moment later = ImageJudgeAt(absl::Seconds(arrived));
      later.time += absl::Seconds(set);
      return of_step.Judge(0, ImageAt(absl::Seconds(stamp)), asked, later);
    };
    EXPECT_FALSE(judge_at(100.1, 102.6).ok()) << "2.5 s old; set by " << set;
    const absl::StatusOr<Moment> taken = judge_at(100.1, 100.2);
    EXPECT_EQ(taken.ok(), set < 0) << set;
    if (taken.ok()) {
      EXPECT_EQ(taken->running, ImageJudgeAt(absl::Seconds(100.1)).running);
    }
    // The next one, stamped after the step, is as any other.
    Moment next = ImageJudgeAt(absl::Seconds(100.3));
    next.time += absl::Seconds(set);
    EXPECT_TRUE(of_step.Judge(0, ImageAt(absl::Seconds(100.3 + set)), next, next).ok()) << set;
  }
}

TEST(FaultLog, FaultIsSaidOnceAndSoIsRecovery) {
  using Log = FaultLog<int>;
  using News = Log::News;
  Log log;
  EXPECT_EQ(log.Note({}, absl::Seconds(1)), News::kNone);
  EXPECT_EQ(log.Note({7}, absl::Seconds(2)), News::kFault);
  EXPECT_EQ(log.Note({7}, absl::Seconds(3)), News::kNone);
  EXPECT_EQ(log.Note({7, 8}, absl::Seconds(3)), News::kFault) << "another kind";
  EXPECT_EQ(log.Note({8}, absl::Seconds(3)), News::kNone);
  EXPECT_EQ(log.Note({}, absl::Seconds(12)), News::kNone) << "not for long";
  EXPECT_EQ(log.Note({7}, absl::Seconds(12.5)), News::kNone);
  EXPECT_EQ(log.Note({}, absl::Seconds(22.5)), News::kRecovered);
  EXPECT_EQ(log.Note({}, absl::Seconds(23)), News::kNone);
  EXPECT_EQ(log.Note({7}, absl::Seconds(24)), News::kFault);
}

TEST(FaultLog, FaultThatComesAndGoesIsLoggedOnce) {
  using Log = FaultLog<int>;
  Log log;
  int lines = 0;
  for (int i = 0; i < 1000; ++i) {
    if (log.Note(i % 2 == 0 ? std::set<int>{7} : std::set<int>{}, i * absl::Milliseconds(500)) !=
        Log::News::kNone) {
      ++lines;
    }
  }
  EXPECT_EQ(lines, 1);
}

TEST(LatencyRecord, TellsMedianTailAndBuckets) {
  LatencyRecord record;
  EXPECT_EQ(record.Figures().count, 0u);
  EXPECT_EQ(record.Figures().median, absl::ZeroDuration());
  for (int i = 1; i <= 100; ++i) record.Add(absl::Milliseconds(i));
  const LatencyFigures figures = record.Figures();
  EXPECT_EQ(figures.count, 100u);
  EXPECT_EQ(figures.median, absl::Milliseconds(50));
  EXPECT_EQ(figures.p99, absl::Milliseconds(99));
  EXPECT_EQ(figures.longest, absl::Milliseconds(100));
  EXPECT_EQ(figures.sum, absl::Milliseconds(5050));
  EXPECT_EQ(figures.within.front(), 1u);
  EXPECT_EQ(figures.within.back(), 100u);
}

TEST(LatencyRecord, ForgetsWhatIsLongAgo) {
  LatencyRecord record;
  record.Add(absl::Seconds(9));
  for (size_t i = 0; i < LatencyRecord::kNewest; ++i) record.Add(absl::Milliseconds(1));
  EXPECT_EQ(record.Figures().longest, absl::Milliseconds(1));
  EXPECT_EQ(record.Figures().count, LatencyRecord::kNewest + 1);
}

TEST(Backoff, WaitsTwiceAsLongEachTimeUpToTheLongest) {
  Backoff backoff(absl::Milliseconds(50), absl::Milliseconds(150));
  EXPECT_EQ(backoff.Next(), absl::Milliseconds(50));
  EXPECT_EQ(backoff.Next(), absl::Milliseconds(100));
  EXPECT_EQ(backoff.Next(), absl::Milliseconds(150));
  EXPECT_EQ(backoff.Next(), absl::Milliseconds(150));
  backoff.Reset();
  EXPECT_EQ(backoff.Next(), absl::Milliseconds(50));
}

TEST(Helpers, DoEachOnceAgainAndAgainWhateverTheirNumber) {
  for (const int threads : {0, 1, 2, 9}) {
    Helpers helpers(threads);
    std::vector<int> done(5);
    for (int round = 1; round <= 200; ++round) {
      helpers.ForEach(done.size(), [&](size_t i) { ++done[i]; });
      ASSERT_EQ(done, std::vector<int>(5, round)) << threads;
    }
    helpers.ForEach(0, [](size_t) { FAIL(); });
  }
}

}  // namespace
}  // namespace silhouette
