// SPDX-License-Identifier: Apache-2.0
// silhouette-capture killed and stopped while it captures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "tests/capture/session/program_cell.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

// Waits until `cell` has at least `records`; the capture goes on.
void WaitForRecords(const ProgramCell& cell, uint64_t records) {
  for (int i = 0; i < 3000 && cell.Records() < records; ++i) absl::SleepFor(absl::Milliseconds(5));
}

// Where no noise differs from image to image, as in ProgramCell.
TEST(KilledCapture, ResumedHoldsWhatAnUninterruptedOneHoldsBitByBit) {
  Random random;
  const std::pair<std::string, std::string> keep_images = {"keep_free: 0 B",
                                                           "raw_images: all\n  keep_free: 0 B"};
  const ProgramCell whole;
  whole.CaptureAll();
  const auto expected = whole.Content();
  ASSERT_THAT(expected, SizeIs(45));

  ProgramCell cell;
  cell.WriteCell({keep_images});
  cell.TakeReferences();
  int kills = 0;
  for (uint64_t stored = 0; kills < 12 && stored < 40; ++kills) {
    const pid_t run = cell.Start(cell.Arguments("run"));
    // Sometimes while it starts, mostly in the middle of the work.
    if (random() % 4 != 0) WaitForRecords(cell, stored + 1);
    absl::SleepFor(absl::Microseconds(random() % 60'000));
    kill(run, SIGKILL);
    cell.Wait(run);
    const uint64_t now = cell.Records();
    EXPECT_GE(now, stored);
    stored = now;
    // What is there is whole and right.
    for (const auto& [number, image] : cell.Content()) EXPECT_EQ(image, expected.at(number));
    EXPECT_EQ(cell.RawImages(), now);
  }
  EXPECT_GE(kills, 2);
  const Outcome last = cell.Run(cell.Arguments("run"));
  EXPECT_EQ(last.exit_code, 0) << last.err;
  EXPECT_EQ(cell.Content(), expected) << kills << " kills";
  EXPECT_EQ(cell.RawImages(), 45u);
}

// A cell whose camera noise differs from image to image, as it does in a real one.
void AddNoise(const ProgramCell& cell) {
  WriteText(cell / "simulation.yaml",
            absl::StrReplaceAll(ReadText(cell / "simulation.yaml"), {{"noise: 0", "noise: 1.5"}}));
}

// # in both masks, 1 and 2 in one of them.
std::string Beside(const Mask& one, const Mask& two) {
  std::string text = "\n";
  for (int y = 0; y < one.height(); ++y) {
    for (int x = 0; x < one.width(); ++x)
      text += ".12#"[(one.at(x, y) ? 1 : 0) + (two.at(x, y) ? 2 : 0)];
    text += '\n';
  }
  return text;
}

// At the rim of the robot, and of its shadow, which reaches some pixels farther and is faint.
TEST(KilledCapture, ResumedDiffersByNoMoreThanTheNoiseAtTheRims) {
  constexpr int kFarthest = 6;
  const ProgramCell whole;
  AddNoise(whole);
  whole.CaptureAll();
  const ProgramCell cell;
  AddNoise(cell);
  cell.TakeReferences();
  const pid_t run = cell.Start(cell.Arguments("run"));
  WaitForRecords(cell, 20);
  kill(run, SIGKILL);
  cell.Wait(run);
  EXPECT_LT(cell.Records(), 45u);
  const Outcome last = cell.Run(cell.Arguments("run"));
  EXPECT_EQ(last.exit_code, 0) << last.err;

  const auto expected = whole.Content();
  const auto content = cell.Content();
  ASSERT_THAT(content, SizeIs(45));
  size_t differing = 0;
  for (const auto& [number, image] : content) {
    for (size_t view = 0; view < image.masks.size(); ++view) {
      const Mask& one = image.masks[view];
      const Mask& other = expected.at(number).masks[view];
      EXPECT_TRUE((one - Grown(other, kFarthest)).Empty()) << number << Beside(one, other);
      EXPECT_TRUE((other - Grown(one, kFarthest)).Empty()) << number << Beside(one, other);
      const size_t pixels = ((one - other) | (other - one)).Count();
      EXPECT_LE(pixels, 16u) << number << Beside(one, other);
      differing += pixels;
    }
  }
  EXPECT_GT(differing, 0u) << "noise is not repeated";
}

TEST(StoppedCapture, EndsCleanlyAndSaysHowToGoOn) {
  for (const int signal : {SIGINT, SIGTERM}) {
    ProgramCell cell;
    cell.WriteCell({{"settle: 5 ms", "settle: 50 ms"}});
    cell.TakeReferences();
    const pid_t run = cell.Start(cell.Arguments("run"));
    WaitForRecords(cell, 3);
    kill(run, signal);
    const Outcome outcome = cell.Wait(run);
    EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("stopped, "));
    EXPECT_THAT(outcome.err, HasSubstr(absl::StrCat("go on with: silhouette-capture run --cell ",
                                                    cell.cell(), " --database ", cell.database())));
    EXPECT_THAT(outcome.out, HasSubstr(absl::StrCat("captured           ", cell.Records(),
                                                    " of 45 configurations")));
    EXPECT_LT(cell.Records(), 45u);
  }
}

TEST(StoppedCapture, OfAllAgainSaysHowToCaptureTheRest) {
  ProgramCell cell;
  cell.WriteCell({{"settle: 5 ms", "settle: 50 ms"}});
  cell.CaptureAll();
  const pid_t run = cell.Start(cell.Arguments("run", {"--only", "all"}));
  const auto begun = [&] {
    const auto database = Database::Open(cell.database(), Database::Access::kRead);
    return database.ok() && (*database)->Read()->CaptureHistory()->suspects_size() > 0;
  };
  for (int i = 0; i < 3000 && !begun(); ++i) absl::SleepFor(absl::Milliseconds(5));
  kill(run, SIGINT);
  Outcome outcome = cell.Wait(run);
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  const std::string rest = absl::StrCat("go on with: silhouette-capture run --cell ", cell.cell(),
                                        " --database ", cell.database(), " --only suspect\n");
  EXPECT_THAT(outcome.err, HasSubstr(rest));
  // Until then they are suspect, and a run of what is missing says so.
  outcome = cell.Run(cell.Arguments("run"));
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("robot images are suspect"));
  outcome = cell.Run(cell.Arguments("run", {"--only", "suspect"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(cell.Run(cell.Arguments("status")).exit_code, 0);
}

TEST(StoppedCapture, OfReferenceImagesStoresNone) {
  ProgramCell cell;
  cell.WriteCell({{"reference_images: 3", "reference_images: 100000"}});
  const pid_t reference = cell.Start(cell.Arguments("reference"));
  for (int i = 0; i < 1000 && !Database::Open(cell.database(), Database::Access::kRead).ok(); ++i) {
    absl::SleepFor(absl::Milliseconds(5));
  }
  absl::SleepFor(absl::Milliseconds(100));
  kill(reference, SIGINT);
  const Outcome outcome = cell.Wait(reference);
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("take them with: silhouette-capture reference"));
  const auto database = Database::Open(cell.database(), Database::Access::kRead);
  ASSERT_TRUE(database.ok()) << database.status();
  EXPECT_FALSE((*database)->Read()->References()->has_value());
}

}  // namespace
}  // namespace silhouette
