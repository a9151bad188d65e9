// SPDX-License-Identifier: Apache-2.0
// Sessions that notice that the cell changed, lose devices and wait for them, and keep images.
#include "capture/session/sentinels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/session/history.h"
#include "capture/session/raw_archive.h"
#include "tests/capture/session/fake_cell.h"

namespace silhouette {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSupersetOf;
using testing::Not;
using testing::SizeIs;

// A camera that looks elsewhere: what it shows lies `by` pixels further to the right.
void MoveCamera(CameraImage& image, int by) {
  const CameraImage before = image;
  const auto width = static_cast<size_t>(image.width);
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    const size_t x = i % width;
    const auto shift = static_cast<size_t>(by);
    image.pixels[i] = x >= shift ? before.pixels[i - shift] : 70;
  }
}

class SentinelsTest : public testing::Test {
 protected:
  SentinelsTest() {
    cell_.settings.sentinels = {.count = 2, .every = absl::InfiniteDuration()};
    cell_.TakeReferences();
    observer_.say = [this](const std::string& line) { said_.push_back(line); };
    observer_.note = [this](const std::string& line) { noted_.push_back(line); };
    observer_.progress = [this](uint64_t done) { done_ = done; };
  }

  // "front", by so many pixels, once so many configurations are captured.
  void MoveFrontAfter(uint64_t done, int by = 4) {
    cell_.rig.on_grab = [this, done, by](size_t, std::vector<CameraImage>& images) {
      if (done_ >= done && moved_) MoveCamera(images[1], by);
      return absl::OkStatus();
    };
  }

  std::vector<ConfigurationNumber> Suspects() const {
    const auto suspects = SuspectNumbers(*cell_.database->Read());
    EXPECT_TRUE(suspects.ok()) << suspects.status();
    return *suspects;
  }

  // The sentinels that the database knows.
  std::vector<ConfigurationNumber> Known() const {
    const auto history = cell_.database->Read()->CaptureHistory();
    EXPECT_TRUE(history.ok()) << history.status();
    return {history->sentinels().begin(), history->sentinels().end()};
  }

  FakeCell cell_;
  CaptureObserver observer_;
  std::vector<std::string> said_;
  std::vector<std::string> noted_;
  uint64_t done_ = 0;
  bool moved_ = true;
};

TEST_F(SentinelsTest, AreWellSpreadAndBeginWithTheFirst) {
  const auto order = cell_.travel->Serpentine();
  const auto chosen = WellSpread(cell_.database->grid(), order, 3);
  ASSERT_THAT(chosen, SizeIs(3));
  EXPECT_EQ(chosen[0], order[0]);
  // The opposite corner of the grid, then another.
  EXPECT_EQ(cell_.database->grid().At(chosen[1]), (Configuration{1, 0.5}));
  EXPECT_THAT(WellSpread(cell_.database->grid(), {order[4]}, 3), ElementsAre(order[4]));
  // Those that are chosen already stay.
  EXPECT_THAT(WellSpread(cell_.database->grid(), order, 2, {chosen[1]}),
              ElementsAre(chosen[1], chosen[0]));
  EXPECT_THAT(WellSpread(cell_.database->grid(), order, 2, chosen),
              ElementsAre(chosen[0], chosen[1]));
}

TEST_F(SentinelsTest, AreVisitedAtIntervalsAndAtTheEnd) {
  cell_.settings.sentinels.every = absl::ZeroDuration();
  const CaptureReport report = cell_.Capture({}, observer_);
  ASSERT_TRUE(report.complete()) << report.status << report.alarm;
  EXPECT_EQ(report.captured, 30u);
  EXPECT_EQ(done_, 30u);
  // Before each of the 28 that are no sentinels, and in the end.
  EXPECT_EQ(report.sentinel_checks, 29u);
  EXPECT_THAT(cell_.Commanded(), SizeIs(30 + 2 * 29));
  EXPECT_THAT(noted_, SizeIs(29));
  EXPECT_THAT(noted_[0], HasSubstr("largest shift 0.00 camera pixels"));
  EXPECT_THAT(said_, IsEmpty());
  EXPECT_EQ(report.suspect, 0u);
  const auto history = cell_.database->Read()->CaptureHistory();
  EXPECT_EQ(history->checks_size(), 29);
  const CaptureRepeatability repeatability = RepeatabilityOf(*history, cell_.database->cell());
  EXPECT_EQ(repeatability.checks, 29);
  EXPECT_EQ(repeatability.views[0].sights, 2 * 29);
  EXPECT_LT(repeatability.views[0].greatest_shift, 0.05);
  EXPECT_EQ(repeatability.views[1].most_mask_pixels, 0);
  // Nothing to do: nobody moves the robot.
  cell_.robot.moves.clear();
  EXPECT_TRUE(cell_.Capture({}, observer_).complete());
  EXPECT_TRUE(cell_.robot.moves.empty());
}

// Makes a square of the image darker: as a shadow does, or so that the cell is no longer seen
// there.
void Darken(CameraImage& image, bool is_shadow) {
  for (int y = 36; y < 58; ++y) {
    for (int x = 4; x < 26; ++x) {
      uint8_t& pixel = image.pixels[static_cast<size_t>(y * image.width + x)];
      pixel = is_shadow ? static_cast<uint8_t>(pixel * 6 / 10) : 48;
    }
  }
}

TEST_F(SentinelsTest, WhetherAPlaceIsAShadowIsNoAlarm) {
  SegmentationSettings segmentation;
  segmentation.shadows = Shadows::kIgnore;
  FakeCell cell(FakeDescription(6, 5, segmentation), QuickSettings(), "", segmentation);
  cell.settings.sentinels = {.count = 2, .every = absl::ZeroDuration()};
  cell.TakeReferences();
  cell.rig.on_grab = [this](size_t, std::vector<CameraImage>& images) {
    Darken(images[1], /*is_shadow=*/done_ < 12);
    return absl::OkStatus();
  };
  const CaptureReport report = cell.Capture({}, observer_);
  EXPECT_TRUE(report.complete()) << report.status << report.alarm;
  // It is one to the masks.
  const auto content = cell.Content();
  size_t least = SIZE_MAX;
  size_t most = 0;
  for (const auto& [number, image] : content) {
    least = std::min(least, image.masks[0].Count());
    most = std::max(most, image.masks[0].Count());
  }
  EXPECT_GT(most, least + 8);
}

TEST_F(SentinelsTest, CameraThatMovedPausesTheSessionWhichNamesViewAndPixels) {
  MoveFrontAfter(12);
  cell_.settings.sentinels.every = absl::ZeroDuration();
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(report.status.ok()) << report.status;
  EXPECT_FALSE(report.complete());
  EXPECT_EQ(report.captured, 12u);
  EXPECT_EQ(cell_.robot.stops, 1);
  EXPECT_THAT(report.alarm, HasSubstr("view 'front' moved by 4.0 px (4.0 px to the right"));
  EXPECT_THAT(report.alarm, Not(HasSubstr("'top'")));
  EXPECT_THAT(said_, ElementsAre(report.alarm));
  // The last good visit was just before the last that was captured.
  EXPECT_EQ(report.suspect, 1u);
}

TEST_F(SentinelsTest, WhatWasCapturedSinceTheLastGoodVisitIsSuspectUntilCapturedAnew) {
  MoveFrontAfter(20);
  const CaptureReport first = cell_.Capture({}, observer_);
  EXPECT_EQ(first.captured, 30u);
  EXPECT_FALSE(first.complete());
  EXPECT_THAT(first.alarm, HasSubstr("view 'front' moved"));
  // All but the sentinels, which were there before.
  EXPECT_EQ(first.suspect, 28u);
  EXPECT_THAT(Suspects(), SizeIs(28));
  // Somebody puts the camera back.
  moved_ = false;
  const CaptureReport second =
      cell_.Capture({.kind = CaptureSelection::Kind::kListed, .listed = Suspects()}, observer_);
  EXPECT_TRUE(second.complete()) << second.status << second.alarm;
  EXPECT_EQ(second.captured, 28u);
  EXPECT_EQ(second.suspect, 0u);
  EXPECT_THAT(Suspects(), IsEmpty());
}

TEST_F(SentinelsTest, CameraThatMovedBetweenTwoSessionsIsFoundBeforeAnythingIsCaptured) {
  observer_.stop_requested = [this] { return done_ == 10; };
  EXPECT_TRUE(cell_.Capture({}, observer_).stopped);
  observer_.stop_requested = [] { return false; };
  MoveFrontAfter(0, 3);
  const CaptureReport second = cell_.Capture({}, observer_);
  EXPECT_THAT(second.alarm, HasSubstr("view 'front' moved by 3.0 px"));
  EXPECT_EQ(second.captured, 0u);
  // Nobody looked after the eight.
  EXPECT_EQ(second.suspect, 8u);
  // If the camera is to stay there, all is captured anew, and the sentinels first.
  cell_.rig.on_grab = nullptr;
  MoveFrontAfter(0, 3);
  cell_.TakeReferences();
  const CaptureReport anew = cell_.Capture({.kind = CaptureSelection::Kind::kAll}, observer_);
  EXPECT_TRUE(anew.complete()) << anew.status << anew.alarm;
  EXPECT_EQ(anew.captured, 30u);
}

TEST_F(SentinelsTest, MoreThanBeforeDoNotHideACameraThatMovedBetweenTwoSessions) {
  observer_.stop_requested = [this] { return done_ == 10; };
  EXPECT_TRUE(cell_.Capture({}, observer_).stopped);
  observer_.stop_requested = [] { return false; };
  const std::vector<ConfigurationNumber> before = Known();
  cell_.settings.sentinels.count = 4;
  MoveFrontAfter(0);
  const CaptureReport moved = cell_.Capture({}, observer_);
  EXPECT_THAT(moved.alarm, HasSubstr("view 'front' moved by 4.0 px"));
  EXPECT_EQ(moved.captured, 0u);
  EXPECT_EQ(Known(), before);
  // Once it is put back, two join those that are known.
  moved_ = false;
  EXPECT_EQ(cell_.Capture({}, observer_).captured, 20u);
  std::vector<ConfigurationNumber> after = Known();
  EXPECT_THAT(after, SizeIs(4));
  after.resize(2);
  EXPECT_EQ(after, before);
  EXPECT_THAT(*cell_.database->Read()->RawImageNumbers(), SizeIs(4));
}

TEST_F(SentinelsTest, FewerThanBeforeAreTheFirstOfThem) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  cell_.robot.moves.clear();
  cell_.settings.sentinels.count = 1;
  MoveFrontAfter(0);
  const CaptureReport report = cell_.Capture({.kind = CaptureSelection::Kind::kNothing}, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("view 'front' moved"));
  EXPECT_THAT(cell_.Commanded(), ElementsAre(cell_.database->grid().At(Known()[0])));
}

TEST_F(SentinelsTest, ForbiddenOneDoesNotHideACameraThatMovedBetweenTwoSessions) {
  observer_.stop_requested = [this] { return done_ == 10; };
  EXPECT_TRUE(cell_.Capture({}, observer_).stopped);
  observer_.stop_requested = [] { return false; };
  // Where the second is, the corner opposite to the first.
  ASSERT_EQ(cell_.database->grid().At(Known()[1]), (Configuration{1, 0.5}));
  cell_.travel.emplace(cell_.database->grid(),
                       std::vector{Region("new", {{"turn", 0.9, 1}, {"lift", 0.45, 1}})});
  MoveFrontAfter(0);
  const CaptureReport report = cell_.Capture({.exclude_captured = true}, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("view 'front' moved by 4.0 px"));
  EXPECT_EQ(report.captured, 0u);
}

TEST_F(SentinelsTest, AreComparedBeforeAllOfThemAreRecapturedUnlessNewOnesAreAskedFor) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  MoveFrontAfter(0);
  CaptureSelection selection{.kind = CaptureSelection::Kind::kListed, .listed = Known()};
  const CaptureReport report = cell_.Capture(selection, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("view 'front' moved"));
  EXPECT_EQ(report.captured, 0u);
  selection.new_sentinels = true;
  EXPECT_TRUE(cell_.Capture(selection, observer_).complete());
}

// A clock that is off by `off_`.
struct SentinelsAndClockTest : SentinelsTest {
  SentinelsAndClockTest() {
    moved_ = false;
    cell_.rig.on_grab = [this](size_t, std::vector<CameraImage>& images) {
      if (moved_) MoveCamera(images[1], 4);
      for (CameraImage& image : images) image.captured += off_;
      return absl::OkStatus();
    };
  }

  CaptureReport CaptureListed(std::vector<ConfigurationNumber> listed) {
    return cell_.Capture({.kind = CaptureSelection::Kind::kListed, .listed = std::move(listed)},
                         observer_);
  }

  absl::Duration off_;
};

TEST_F(SentinelsAndClockTest, AfterASessionWhoseClockRanAheadAllIsSuspectUntilRecaptured) {
  off_ = absl::Hours(1);
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  off_ = absl::ZeroDuration();
  moved_ = true;
  const CaptureReport report = cell_.Capture({.kind = CaptureSelection::Kind::kNothing}, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("view 'front' moved"));
  EXPECT_EQ(report.suspect, 30u);
  moved_ = false;
  const CaptureReport again = CaptureListed(Suspects());
  EXPECT_TRUE(again.complete()) << again.alarm;
  EXPECT_EQ(again.captured, 30u);
  EXPECT_THAT(Suspects(), IsEmpty());
}

TEST_F(SentinelsAndClockTest, WhatIsCapturedAfterTheClockWasSetBackIsSuspect) {
  observer_.progress = [this](uint64_t done) {
    if (done == 10) off_ = -absl::Hours(1);
    moved_ = done >= 20;
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("view 'front' moved"));
  EXPECT_GE(report.suspect, 28u);
}

TEST_F(SentinelsAndClockTest, WhatIsCapturedAfterTheClockWasSetBackIsSuspectInTheNextSession) {
  off_ = -absl::Minutes(1);
  int checks = 0;
  observer_.progress = [&, this](uint64_t done) {
    if (done == 10) off_ = -absl::Hours(1);
    if (done == 15) ++checks;
  };
  observer_.stop_requested = [&] { return checks > 0; };
  EXPECT_TRUE(cell_.Capture({}, observer_).stopped);
  observer_.stop_requested = [] { return false; };
  observer_.progress = [](uint64_t) {};
  off_ = absl::ZeroDuration();
  moved_ = true;
  const CaptureReport report = cell_.Capture({.kind = CaptureSelection::Kind::kNothing}, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("view 'front' moved"));
  EXPECT_GE(report.suspect, 4u) << "those after the clock was set back and checked";
}

TEST_F(SentinelsAndClockTest, WhatASessionWithAClockThatIsBehindRecapturedIsSuspect) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  const auto order = cell_.travel->Serpentine();
  const std::vector<ConfigurationNumber> some(order.begin() + 10, order.begin() + 13);
  off_ = -absl::Hours(24);
  observer_.stop_requested = [this] { return done_ == 2; };
  EXPECT_TRUE(CaptureListed(some).stopped);
  observer_.stop_requested = [] { return false; };
  off_ = absl::ZeroDuration();
  moved_ = true;
  EXPECT_THAT(CaptureListed({some[2]}).alarm, HasSubstr("view 'front' moved"));
  EXPECT_THAT(Suspects(), IsSupersetOf({some[0], some[1]}));
}

TEST_F(SentinelsTest, SomebodyMayMendItWhileTheRobotStandsStill) {
  MoveFrontAfter(30);
  observer_.alarm = [this](const std::string&) {
    moved_ = false;
    return AfterAlarm::kCheckAgain;
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(report.complete()) << report.alarm;
  EXPECT_EQ(said_.back(), "the cell is as it was");
  EXPECT_EQ(report.suspect, 28u);
}

TEST_F(SentinelsTest, WhoGoesOnNonethelessHasItNoted) {
  cell_.settings.sentinels.every = absl::ZeroDuration();
  MoveFrontAfter(12);
  int asked = 0;
  observer_.alarm = [&](const std::string&) {
    ++asked;
    return AfterAlarm::kGoOn;
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(report.captured, 30u);
  EXPECT_FALSE(report.complete());
  EXPECT_EQ(report.suspect, 19u);
}

TEST_F(SentinelsTest, WhatAnAlarmMakesSuspectIsKeptBeforeAnythingElseHappens) {
  MoveFrontAfter(30);
  size_t suspect = 0;
  observer_.say = [&](const std::string&) { suspect = Suspects().size(); };
  EXPECT_FALSE(cell_.Capture({}, observer_).complete());
  EXPECT_EQ(suspect, 28u);
}

TEST_F(SentinelsTest, WhatIsCapturedNonethelessIsSuspectWheneverTheSessionIsKilled) {
  cell_.settings.commit_interval = absl::ZeroDuration();
  observer_.stop_requested = [this] { return done_ == 10; };
  EXPECT_TRUE(cell_.Capture({}, observer_).stopped);
  observer_.stop_requested = [] { return false; };
  MoveFrontAfter(0);
  observer_.alarm = [](const std::string&) { return AfterAlarm::kGoOn; };
  observer_.progress = [this](uint64_t) {
    EXPECT_EQ(Suspects().size() + 2, cell_.Content().size()) << "all but the sentinels";
  };
  EXPECT_EQ(cell_.Capture({}, observer_).suspect, 28u);
  const auto history = cell_.database->Read()->CaptureHistory();
  ASSERT_EQ(history->suspects_size(), 1);
  EXPECT_LE(TimeOf(history->suspects(0).until()), absl::Now());
}

TEST_F(SentinelsTest, WhatIsCapturedNonethelessIsSuspectAlsoIfTheyMatchAgain) {
  cell_.settings.sentinels.every = absl::ZeroDuration();
  MoveFrontAfter(12);
  observer_.alarm = [](const std::string&) { return AfterAlarm::kGoOn; };
  observer_.progress = [this](uint64_t done) {
    done_ = done;
    if (done == 20) moved_ = false;
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_EQ(report.captured, 30u);
  EXPECT_EQ(report.suspect, 19u);
}

TEST_F(SentinelsTest, SuspectSpanOfAKilledSessionEndsWhereTheNextBegins) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  const absl::Status changed =
      ChangeHistory(*cell_.database, [](storage::v1::CaptureHistory& history) {
        storage::v1::SuspectSpan& span = *history.add_suspects();
        SetTime(absl::InfinitePast(), *span.mutable_after());
        SetTime(absl::InfiniteFuture(), *span.mutable_until());
      });
  ASSERT_TRUE(changed.ok()) << changed;
  EXPECT_THAT(Suspects(), SizeIs(30));
  const ConfigurationNumber one = cell_.travel->Serpentine()[10];
  const CaptureReport report =
      cell_.Capture({.kind = CaptureSelection::Kind::kListed, .listed = {one}}, observer_);
  EXPECT_TRUE(report.complete()) << report.status << report.alarm;
  EXPECT_THAT(Suspects(), SizeIs(29));
  EXPECT_THAT(Suspects(), Not(Contains(one)));
}

// All is captured again, with the camera where it is now.
struct AllAgainTest : SentinelsTest {
  void CaptureAndMoveFront() {
    ASSERT_TRUE(cell_.Capture({}, observer_).complete());
    done_ = 0;
    MoveFrontAfter(0);
    cell_.TakeReferences();
  }

  CaptureReport CaptureSuspects() {
    return cell_.Capture({.kind = CaptureSelection::Kind::kListed, .listed = Suspects()},
                         observer_);
  }

  const CaptureSelection all_{.kind = CaptureSelection::Kind::kAll};
};

TEST_F(AllAgainTest, ThatEndsEarlyLeavesTheOthersSuspectUntilTheyAreCaptured) {
  CaptureAndMoveFront();
  observer_.stop_requested = [this] { return done_ == 10; };
  const CaptureReport begun = cell_.Capture(all_, observer_);
  EXPECT_TRUE(begun.stopped);
  EXPECT_EQ(begun.captured, 10u);
  EXPECT_EQ(begun.suspect, 20u);
  observer_.stop_requested = [] { return false; };
  const CaptureReport alone = cell_.Capture({.kind = CaptureSelection::Kind::kNothing}, observer_);
  EXPECT_EQ(alone.alarm, "") << "those that are to be replaced count no more";
  // The sentinels are compared as they look since then.
  const CaptureReport rest = CaptureSuspects();
  EXPECT_TRUE(rest.complete()) << rest.status << rest.alarm;
  EXPECT_EQ(rest.captured, 20u);
  EXPECT_EQ(rest.sentinel_checks, 2u);
  EXPECT_EQ(rest.suspect, 0u);
  EXPECT_EQ(cell_.database->Read()->CaptureHistory()->suspects_size(), 0);
}

TEST_F(AllAgainTest, LeavesNothingSuspectOnceItIsComplete) {
  CaptureAndMoveFront();
  const CaptureReport report = cell_.Capture(all_, observer_);
  EXPECT_TRUE(report.complete()) << report.status << report.alarm;
  EXPECT_EQ(report.suspect, 0u);
  EXPECT_EQ(cell_.database->Read()->CaptureHistory()->suspects_size(), 0);
}

TEST_F(AllAgainTest, MakesNothingSuspectBeforeItCapturesAnything) {
  CaptureAndMoveFront();
  cell_.robot.on_move = [](size_t) { return absl::CancelledError("stopped by the operator"); };
  EXPECT_TRUE(cell_.Capture(all_, observer_).stopped);
  EXPECT_THAT(Suspects(), IsEmpty());
}

TEST_F(AllAgainTest, SentinelThatItDidNotReachIsNotComparedAsItWasBefore) {
  cell_.settings.sentinels.count = 1;
  CaptureAndMoveFront();
  const Configuration missed = cell_.database->grid().At(Known()[0]);
  cell_.robot.on_state = [&](RobotState& state) {
    if (cell_.robot.at[2] == missed[0] && cell_.robot.at[1] == missed[1]) state.positions[1] += 0.1;
    return absl::OkStatus();
  };
  const CaptureReport begun = cell_.Capture(all_, observer_);
  EXPECT_EQ(begun.captured, 29u);
  EXPECT_EQ(begun.suspect, 1u);
  cell_.robot.on_state = nullptr;
  const CaptureReport rest = CaptureSuspects();
  EXPECT_TRUE(rest.complete()) << rest.status << rest.alarm;
  EXPECT_EQ(rest.captured, 1u);
  EXPECT_EQ(rest.suspect, 0u);
}

TEST_F(SentinelsTest, ThatASessionDidNotVisitInTheEndAreVisitedWithNothingLeftToCapture) {
  cell_.rig.on_grab = [](size_t grab, std::vector<CameraImage>&) {
    return grab > 30 ? absl::InternalError("the camera is gone") : absl::OkStatus();
  };
  const CaptureReport first = cell_.Capture({}, observer_);
  EXPECT_FALSE(first.status.ok());
  EXPECT_EQ(first.captured, 30u);
  MoveFrontAfter(0);
  const CaptureReport second = cell_.Capture({}, observer_);
  EXPECT_THAT(second.alarm, HasSubstr("view 'front' moved"));
  EXPECT_EQ(second.suspect, 28u);
  moved_ = false;
  EXPECT_EQ(cell_.Capture({}, observer_).sentinel_checks, 1u);
  // Once they matched, not again.
  cell_.robot.moves.clear();
  EXPECT_EQ(cell_.Capture({}, observer_).sentinel_checks, 0u);
  EXPECT_THAT(cell_.robot.moves, IsEmpty());
}

TEST_F(SentinelsTest, LightFromElsewhereIsNoMovedCamera) {
  cell_.rig.on_grab = [this](size_t, std::vector<CameraImage>& images) {
    for (size_t i = 0; done_ >= 30 && i < images[0].pixels.size(); ++i) {
      if (i % 64 > 50) images[0].pixels[i] = static_cast<uint8_t>(images[0].pixels[i] * 2);
    }
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("view 'top' has another mask by"));
  EXPECT_THAT(report.alarm, HasSubstr("the light changed"));
  EXPECT_THAT(report.alarm, Not(HasSubstr("'front'")));
}

TEST_F(SentinelsTest, DimmerLightIsTold) {
  cell_.rig.on_grab = [this](size_t, std::vector<CameraImage>& images) {
    for (uint8_t& pixel : images[1].pixels) {
      if (done_ >= 30) pixel = static_cast<uint8_t>(pixel * 0.7);
    }
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("times as bright as it was: the light changed"));
  EXPECT_THAT(report.alarm, Not(HasSubstr("'top'")));
}

TEST_F(SentinelsTest, AloneCanBeVisited) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  cell_.robot.moves.clear();
  const CaptureSelection nothing{.kind = CaptureSelection::Kind::kNothing};
  const CaptureReport report = cell_.Capture(nothing, observer_);
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.sentinel_checks, 1u);
  EXPECT_THAT(cell_.Commanded(), SizeIs(2));
  MoveFrontAfter(0);
  EXPECT_THAT(cell_.Capture(nothing, observer_).alarm, HasSubstr("view 'front' moved"));
}

TEST_F(SentinelsTest, ThatCannotBeVisitedAreNoGoodCheck) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  cell_.robot.on_state = [](RobotState& state) {
    state.positions[1] += 0.1;
    return absl::OkStatus();
  };
  const CaptureSelection nothing{.kind = CaptureSelection::Kind::kNothing};
  const CaptureReport report = cell_.Capture(nothing, observer_);
  EXPECT_FALSE(report.complete());
  EXPECT_THAT(report.alarm, HasSubstr("no control configuration could be visited"));
  EXPECT_TRUE(report.none_visited);
  EXPECT_THAT(report.alarm, HasSubstr("off by 0.1000"));
  EXPECT_THAT(report.alarm, HasSubstr("sentinels: {count}"));
  cell_.robot.on_state = nullptr;
  EXPECT_TRUE(cell_.Capture(nothing, observer_).complete());
}

TEST_F(SentinelsTest, OneThatCannotBeVisitedLeavesTheOthers) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  cell_.robot.on_state = [this](RobotState& state) {
    if (cell_.robot.at[2] > 0.9) state.positions[1] += 0.1;
    return absl::OkStatus();
  };
  EXPECT_TRUE(cell_.Capture({.kind = CaptureSelection::Kind::kNothing}, observer_).complete());
}

TEST_F(SentinelsTest, ThatAreNotKnownCannotBeVisitedAlone) {
  const CaptureSelection nothing{.kind = CaptureSelection::Kind::kNothing};
  CaptureReport report = cell_.Capture(nothing, observer_);
  EXPECT_TRUE(absl::IsFailedPrecondition(report.status)) << report.status;
  EXPECT_THAT(report.status.message(), HasSubstr("--new-sentinels"));
  cell_.settings.sentinels.count = 0;
  report = cell_.Capture(nothing, observer_);
  EXPECT_TRUE(absl::IsFailedPrecondition(report.status)) << report.status;
  EXPECT_THAT(report.status.message(), HasSubstr("state 'sentinels: {count: 3}'"));
  EXPECT_TRUE(cell_.robot.moves.empty());
}

TEST_F(SentinelsTest, OfACellThatKeepsNoImagesAreComparedByTheirMasks) {
  cell_.settings.raw_images = RawImages::kNone;
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  EXPECT_THAT(*cell_.database->Read()->RawImageNumbers(), IsEmpty());
  MoveFrontAfter(0, 12);
  const CaptureReport report = cell_.Capture({.kind = CaptureSelection::Kind::kNothing}, observer_);
  EXPECT_THAT(report.alarm, HasSubstr("view 'front' has another mask"));
}

// Images that are kept.

TEST_F(SentinelsTest, ImagesOfAllConfigurationsAreKeptAsTheCameraTookThem) {
  cell_.settings.raw_images = RawImages::kAll;
  std::vector<CameraImage> last;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>& images) {
    if (done_ == 29) last = images;
    return absl::OkStatus();
  };
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  const auto snapshot = cell_.database->Read();
  EXPECT_THAT(*snapshot->RawImageNumbers(), SizeIs(30));
  const auto raw = snapshot->FindRawImage(cell_.travel->Serpentine().back(), 0);
  ASSERT_TRUE(raw.ok() && raw->has_value());
  const cv::Mat image = ImageInPng((*raw)->png);
  ASSERT_EQ(image.size(), cv::Size(80, 60));
  EXPECT_EQ(snapshot->ReferencesOf((*raw)->references)->views_size(), 2);
  // What was estimated beforehand holds.
  uint64_t bytes = 0;
  for (int v = 0; v < 2; ++v) {
    bytes += (**snapshot->FindRawImage(cell_.travel->Serpentine().back(), v)).png.size();
  }
  const uint64_t estimate = EstimateRawBytes(cell_.database->cell(), cell_.database.get());
  EXPECT_GT(estimate, bytes);
  EXPECT_LT(estimate, 2 * bytes);
}

TEST_F(SentinelsTest, OnlyTheirImagesAreKeptUnlessAskedFor) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  const auto history = cell_.database->Read()->CaptureHistory();
  ASSERT_EQ(history->sentinels_size(), 2);
  const auto kept = cell_.database->Read()->RawImageNumbers();
  EXPECT_THAT(*kept, SizeIs(2));
  EXPECT_THAT(*kept, Contains(history->sentinels(0)));
}

// Devices and disks that fail.

TEST_F(SentinelsTest, LostCameraIsWaitedFor) {
  cell_.settings.retry = absl::Seconds(20);
  size_t lost = 0;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>&) {
    const bool gone = done_ == 10 && ++lost <= 2 * CellCameras::kAttempts;
    return gone ? absl::DeadlineExceededError("view 'top' gave no image") : absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(report.complete()) << report.status;
  EXPECT_EQ(report.losses, 1u);
  EXPECT_GT(report.waited, absl::ZeroDuration());
  EXPECT_THAT(said_, Contains(HasSubstr("view 'top' gave no image; waiting up to 20 s")));
  EXPECT_THAT(said_.back(), HasSubstr("it is back, after"));
}

// Loses the robot once, after ten configurations.
struct LostRobotTest : SentinelsTest {
  void SetUp() override {
    cell_.settings.retry = absl::Milliseconds(500);
    cell_.robot.on_state = [this](RobotState&) {
      if (done_ != 10 || told_ == 2) return absl::OkStatus();
      if (++told_ == 2) moves_at_return_ = cell_.robot.moves.size();
      return absl::UnavailableError("the robot's controller does not answer");
    };
  }

  int told_ = 0;  // how often it was away
  size_t moves_at_return_ = 0;
};

TEST_F(LostRobotTest, DoesNotMoveOnUnlessSomebodySaysSo) {
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(absl::IsAborted(report.status)) << report.status;
  EXPECT_THAT(
      report.status.message(),
      HasSubstr("the robot was lost, or a stop command did not reach it; it does not move"));
  EXPECT_EQ(report.captured, 10u);
  EXPECT_EQ(cell_.robot.moves.size(), moves_at_return_);
  EXPECT_GE(cell_.robot.stops, 1);
  // The same command goes on.
  EXPECT_EQ(cell_.Capture({}, observer_).captured, 20u);
}

TEST_F(LostRobotTest, MovesOnWhenSomebodySaysSo) {
  int asked = 0;
  observer_.robot_may_move = [&] {
    EXPECT_EQ(cell_.robot.moves.size(), moves_at_return_);
    return ++asked == 1;
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(report.complete()) << report.status;
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(report.losses, 1u);
}

TEST_F(LostRobotTest, MovesOnByItselfWhereTheCellSaysSo) {
  cell_.settings.continue_after_reconnect = true;
  observer_.robot_may_move = [] {
    ADD_FAILURE() << "nobody is to be asked";
    return false;
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(report.complete()) << report.status;
}

TEST_F(LostRobotTest, WhileACameraIsWaitedForIsAskedForToo) {
  size_t lost = 0;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>&) {
    const bool gone = done_ == 10 && ++lost <= CellCameras::kAttempts;
    return gone ? absl::UnavailableError("view 'top' is gone") : absl::OkStatus();
  };
  cell_.robot.on_state = [&](RobotState&) {
    const bool gone = lost == CellCameras::kAttempts && ++told_ == 1;
    return gone ? absl::UnavailableError("the robot's controller does not answer")
                : absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(absl::IsAborted(report.status)) << report.status;
  EXPECT_EQ(report.captured, 10u);
}

TEST_F(SentinelsTest, RobotThatCannotBeStoppedWhileACameraIsWaitedForIsAskedForToo) {
  cell_.settings.retry = absl::Milliseconds(500);
  size_t lost = 0;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>&) {
    const bool gone = done_ == 10 && ++lost <= CellCameras::kAttempts;
    return gone ? absl::UnavailableError("view 'top' is gone") : absl::OkStatus();
  };
  cell_.robot.on_stop = [] { return absl::DeadlineExceededError("no answer"); };
  for (const bool continues : {false, true}) {
    lost = 0;
    cell_.settings.continue_after_reconnect = continues;
    const CaptureReport report = cell_.Capture({}, observer_);
    EXPECT_EQ(absl::IsAborted(report.status), !continues) << report.status;
    EXPECT_EQ(report.captured, continues ? 20u : 10u);
  }
}

TEST_F(SentinelsTest, RobotThatDoesNotComeBackEndsTheSessionSafely) {
  cell_.settings.retry = absl::Milliseconds(300);
  cell_.robot.on_state = [this](RobotState&) {
    return done_ >= 10 ? absl::UnavailableError("the robot's controller does not answer")
                       : absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(absl::IsUnavailable(report.status)) << report.status;
  EXPECT_THAT(report.status.message(), HasSubstr("did not come back within"));
  EXPECT_EQ(report.captured, 10u);
  EXPECT_GE(cell_.robot.stops, 1);
}

TEST_F(SentinelsTest, OperatorWhoStopsTheRobotStopsTheSessionWithoutAFault) {
  for (const size_t last : {1u, 10u, 30u}) {
    cell_.robot.moves.clear();
    cell_.robot.on_move = [&](size_t move) {
      return move == last ? absl::CancelledError("stopped by the operator") : absl::OkStatus();
    };
    const CaptureReport report = cell_.Capture({.kind = CaptureSelection::Kind::kAll}, observer_);
    EXPECT_TRUE(report.status.ok()) << report.status;
    EXPECT_TRUE(report.stopped);
    EXPECT_EQ(report.captured, last - 1);
    EXPECT_THAT(cell_.robot.moves, SizeIs(last)) << "it is asked to move on";
  }
  cell_.robot.on_move = nullptr;
  EXPECT_TRUE(cell_.Capture({}, observer_).complete());
}

TEST_F(SentinelsTest, OperatorWhoStopsTheRobotOnItsWayToASentinelStopsTheSession) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  cell_.robot.moves.clear();
  cell_.robot.on_move = [](size_t) { return absl::CancelledError("stopped by the operator"); };
  const CaptureReport report = cell_.Capture({.kind = CaptureSelection::Kind::kNothing}, observer_);
  EXPECT_TRUE(report.status.ok()) << report.status;
  EXPECT_TRUE(report.stopped);
  EXPECT_EQ(report.sentinel_checks, 0u);
  EXPECT_THAT(cell_.robot.moves, SizeIs(1));
}

TEST_F(SentinelsTest, StopEndsTheSessionBeforeTheNextOfThem) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  cell_.robot.moves.clear();
  observer_.stop_requested = [this] { return !cell_.robot.moves.empty(); };
  const CaptureReport report = cell_.Capture({.kind = CaptureSelection::Kind::kNothing}, observer_);
  EXPECT_TRUE(report.stopped) << report.status;
  EXPECT_EQ(report.sentinel_checks, 0u);
  EXPECT_THAT(cell_.robot.moves, SizeIs(1));
}

TEST_F(SentinelsTest, NewOnesAreLeftUntilAllOfThemAreCaptured) {
  ASSERT_TRUE(cell_.Capture({}, observer_).complete());
  const CaptureSelection again{
      .kind = CaptureSelection::Kind::kListed, .listed = Known(), .new_sentinels = true};
  done_ = 0;
  observer_.stop_requested = [this] { return done_ == 1; };
  EXPECT_TRUE(cell_.Capture(again, observer_).new_sentinels_left);
  observer_.stop_requested = [] { return false; };
  EXPECT_FALSE(cell_.Capture(again, observer_).new_sentinels_left);
}

TEST_F(SentinelsTest, RobotThatDoesNotArriveIsNotSentAgainAndAgain) {
  cell_.settings.retry = absl::Hours(1);
  cell_.robot.on_move = [](size_t move) {
    return move == 5 ? absl::DeadlineExceededError("the robot did not arrive") : absl::OkStatus();
  };
  EXPECT_TRUE(absl::IsDeadlineExceeded(cell_.Capture({}, observer_).status));
}

TEST_F(SentinelsTest, SessionEndsBeforeTheDiskIsFull) {
  cell_.settings.commit_interval = absl::ZeroDuration();
  cell_.settings.keep_free = uint64_t{1} << 62;
  const CaptureReport report = cell_.Capture({}, observer_);
  EXPECT_TRUE(absl::IsResourceExhausted(report.status)) << report.status;
  EXPECT_THAT(report.status.message(), HasSubstr("that are to stay free (keep_free); make room"));
  EXPECT_LT(report.captured, 30u);
  EXPECT_THAT(cell_.Content(), SizeIs(report.captured));
}

}  // namespace
}  // namespace silhouette
