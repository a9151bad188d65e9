// SPDX-License-Identifier: Apache-2.0
#include "capture/session/capture_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>

#include "capture/devices/running_clock.h"
#include "capture/session/history.h"
#include "capture/session/raw_archive.h"
#include "capture/session/remask.h"
#include "tests/capture/session/fake_cell.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

class CaptureSessionTest : public testing::Test {
 protected:
  void SetUp() override { cell_.TakeReferences(); }

  FakeCell cell_;
};

TEST_F(CaptureSessionTest, StoresEveryConfigurationWithAllItsViews) {
  const CaptureReport report = cell_.Capture();
  ASSERT_TRUE(report.complete()) << report.status;
  EXPECT_EQ(report.captured, 30u);
  EXPECT_EQ(cell_.Commanded().size(), 30u);
  const auto content = cell_.Content();
  ASSERT_THAT(content, SizeIs(30));
  for (const auto& [number, image] : content) {
    const Configuration at = cell_.database->grid().At(number);
    EXPECT_EQ(image.commanded, (std::vector<double>{at[0], at[1], 0.25}));
    EXPECT_EQ(image.measured, image.commanded);
    ASSERT_THAT(image.masks, SizeIs(2));
    // The box begins at 20 * (turn + 1.3) camera pixels, of which "front" has 5 to a mask pixel.
    const int left = static_cast<int>((at[0] + 1.3) * 20);
    EXPECT_FALSE(image.masks[0].Empty());
    for (int x = 0; x < 16; ++x) {
      bool column = false;
      for (int y = 0; y < 16; ++y) column |= image.masks[0].at(x, y);
      EXPECT_EQ(column, 5 * x + 5 > left && 5 * x < left + 9) << "column " << x;
    }
  }
}

TEST_F(CaptureSessionTest, ReportTellsTheQualityOfEachView) {
  cell_.rig.on_grab = [](size_t grab, std::vector<CameraImage>& images) {
    if (grab <= 4) {  // no robot in "front"
      for (size_t i = 0; i < images[1].pixels.size(); ++i) {
        images[1].pixels[i] = FakeBackground(i % 80, i / 80);
      }
    }
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  ASSERT_TRUE(report.complete()) << report.status;
  ASSERT_THAT(report.views, SizeIs(2));
  EXPECT_EQ(report.views[0].name, "front");
  EXPECT_EQ(report.views[0].images, 30u);
  EXPECT_EQ(report.views[0].empty, 4u);
  EXPECT_EQ(report.views[1].empty, 0u);
  // In "top" the box begins in the first row where lift is 0.
  EXPECT_EQ(report.views[1].touching_border, 6u);
  EXPECT_GT(report.views[1].mean_area(), 10);
  EXPECT_EQ(report.max_deviation, 0);
}

TEST_F(CaptureSessionTest, SecondRunHasNothingToDo) {
  ASSERT_TRUE(cell_.Capture().complete());
  cell_.robot.moves.clear();
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.planned, 0u);
  EXPECT_EQ(report.kept, 30u);
  EXPECT_TRUE(cell_.robot.moves.empty());
}

TEST_F(CaptureSessionTest, ListedConfigurationsAreReplaced) {
  ASSERT_TRUE(cell_.Capture().complete());
  const auto before = cell_.Content();
  cell_.rig.robot_present = false;
  const ConfigurationNumber anew = before.begin()->first;
  const CaptureReport report =
      cell_.Capture({.kind = CaptureSelection::Kind::kListed, .listed = {anew}});
  ASSERT_TRUE(report.complete()) << report.status;
  EXPECT_EQ(report.captured, 1u);
  auto after = cell_.Content();
  EXPECT_TRUE(after[anew].masks[0].Empty());
  after[anew] = before.at(anew);
  EXPECT_EQ(after, before);
}

TEST_F(CaptureSessionTest, RobotThatNeverArrivesEndsTheSessionWithWhatIsThere) {
  cell_.robot.on_move = [](size_t move) {
    return move == 12 ? absl::DeadlineExceededError("the robot did not arrive within 30 s")
                      : absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(absl::IsDeadlineExceeded(report.status)) << report.status;
  EXPECT_EQ(report.captured, 11u);
  EXPECT_THAT(cell_.Content(), SizeIs(11));
  EXPECT_EQ(cell_.robot.stops, 1);
}

TEST_F(CaptureSessionTest, RobotAtTheWrongPlaceIsNotStored) {
  const auto order = cell_.travel->Serpentine();
  size_t measured = 0;
  cell_.robot.on_state = [&](RobotState& state) {
    if (cell_.robot.moves.size() == 5) state.positions[1] += 0.01;
    ++measured;
    return absl::OkStatus();
  };
  std::vector<std::string> said;
  CaptureObserver observer;
  observer.say = [&](const std::string& line) { said.push_back(line); };
  const CaptureReport report = cell_.Capture({}, observer);
  EXPECT_TRUE(report.status.ok()) << report.status;
  EXPECT_FALSE(report.complete());
  EXPECT_EQ(report.failed, 1u);
  EXPECT_EQ(report.captured, 29u);
  EXPECT_FALSE(cell_.Content().contains(order[4]));
  ASSERT_THAT(said, SizeIs(1));
  EXPECT_THAT(said[0], HasSubstr("off by 0.0100, more than 0.0020"));
  // The next run brings it.
  cell_.robot.on_state = nullptr;
  EXPECT_EQ(cell_.Capture().captured, 1u);
  EXPECT_THAT(cell_.Content(), SizeIs(30));
}

TEST_F(CaptureSessionTest, FixedJointAtTheWrongPlaceIsNotStored) {
  cell_.robot.on_state = [](RobotState& state) {
    state.positions[0] += 0.1;  // wrist
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(absl::IsAborted(report.status)) << report.status;
  EXPECT_THAT(report.status.message(),
              AllOf(HasSubstr("3 times in a row"),
                    HasSubstr("the joint 'wrist' is at 0.3500 instead of 0.2500")));
  EXPECT_EQ(report.failed, 3u);
  EXPECT_THAT(cell_.Content(), SizeIs(0));
}

TEST_F(CaptureSessionTest, RobotThatLeavesWhileImagesAreTakenStopsTheSession) {
  bool push = false;
  cell_.rig.on_grab = [&](size_t grab, std::vector<CameraImage>&) {
    push = grab == 7;
    return absl::OkStatus();
  };
  cell_.robot.on_state = [&](RobotState& state) {
    if (push) state.positions[2] += 0.02;
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(absl::IsAborted(report.status)) << report.status;
  EXPECT_THAT(report.status.message(), HasSubstr("moved by 0.0200 while its images were taken"));
  EXPECT_EQ(report.captured, 6u);
  EXPECT_EQ(cell_.robot.stops, 1);
  // Resumed, all is captured.
  push = false;
  cell_.rig.on_grab = nullptr;
  EXPECT_TRUE(cell_.Capture().complete());
  EXPECT_THAT(cell_.Content(), SizeIs(30));
}

TEST_F(CaptureSessionTest, RobotThatLeavesWhileImagesAreTakenIsFoundThoughItReportsLate) {
  bool pushed = false;
  int reports = 0;  // since then
  absl::Duration first;
  cell_.rig.on_grab = [&](size_t grab, std::vector<CameraImage>&) {
    pushed = pushed || grab == 7;
    first = RunningNow();
    return absl::OkStatus();
  };
  cell_.robot.on_state = [&](RobotState& state) {
    const bool late = pushed && ++reports <= 3;
    state.not_before = late ? first - absl::Milliseconds(900) : RunningNow();
    if (pushed && !late) state.positions[2] += 0.02;
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(absl::IsAborted(report.status)) << report.status;
  EXPECT_THAT(report.status.message(), HasSubstr("moved by 0.0200 while its images were taken"));
  EXPECT_EQ(report.captured, 6u);
}

TEST_F(CaptureSessionTest, ImagesOfARobotThatSwingsAreNotTaken) {
  // As the first set of every visit shows it, the robot is not yet where it is in the end.
  cell_.settings.still_images = 2;
  cell_.settings.settle_timeout = absl::Seconds(60);
  size_t moves = 0;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>& images) {
    if (std::exchange(moves, cell_.robot.moves.size()) == moves) return absl::OkStatus();
    std::rotate(images[0].pixels.begin(), images[0].pixels.begin() + 5, images[0].pixels.end());
    return absl::OkStatus();
  };
  ASSERT_TRUE(cell_.Capture().complete());
  const auto swinging = cell_.Content();
  EXPECT_EQ(cell_.rig.grabs, 30u * 3) << "one that swings, two that are alike";

  FakeCell still;
  still.TakeReferences();
  ASSERT_TRUE(still.Capture().complete());
  EXPECT_EQ(swinging, still.Content());
}

// What one of two still images shows of the robot, by noise, it may show again in a scene.
TEST_F(CaptureSessionTest, RobotImageIsTheUnionOfTheStillImages) {
  cell_.settings.still_images = 2;
  cell_.settings.raw_images = RawImages::kAll;
  // Too faint for the images to count as different: at the left in the first, at the right in the
  // second.
  cell_.rig.on_grab = [&](size_t grab, std::vector<CameraImage>& images) {
    for (int y = 45; y < 57; ++y) {
      for (int x = 0; x < 12; ++x) {
        images[0].pixels[static_cast<size_t>(y * 64 + x + (grab % 2 == 1 ? 3 : 50))] += 5;
      }
    }
    return absl::OkStatus();
  };
  ASSERT_TRUE(cell_.Capture().complete());
  EXPECT_EQ(cell_.rig.grabs, 60u);
  const auto united = cell_.Content();
  for (const auto& [number, image] : united) {
    const Mask& top = image.masks[1];
    EXPECT_TRUE(top.at(3, 16)) << "in the first image, " << number;
    EXPECT_TRUE(top.at(17, 16)) << "in the second image, " << number;
    EXPECT_FALSE(top.at(10, 16)) << "in none, " << number;
  }
  // Both images are kept, and give the same masks again.
  const auto raw = cell_.database->Read()->FindRawImage(0, 1);
  ASSERT_TRUE(raw.ok() && raw->has_value());
  EXPECT_THAT(ImagesInPng((*raw)->png), SizeIs(2));
  FakeCell other;
  const auto remasked = Remask(*cell_.database, {}, "test", *other.database);
  ASSERT_TRUE(remasked.ok()) << remasked.status();
  EXPECT_EQ(other.Content(), united);
}

TEST_F(CaptureSessionTest, RemaskedVariantsAreAsSuspectAsTheyWere) {
  cell_.settings.raw_images = RawImages::kAll;
  ASSERT_TRUE(cell_.Capture().complete());
  const auto variant = cell_.database->CreateVariant("with-part", "test");
  ASSERT_TRUE(variant.ok()) << variant.status();
  storage::v1::CaptureHistory history;
  history.add_sentinels(4);
  SetTime(absl::Now(), *history.add_suspects()->mutable_until());
  ASSERT_TRUE(cell_.database->SetCaptureHistory(history).ok());
  history.add_sentinels(5);
  ASSERT_TRUE((*variant)->SetCaptureHistory(history).ok());
  FakeCell other;
  const auto remasked = Remask(*cell_.database, {}, "test", *other.database);
  ASSERT_TRUE(remasked.ok()) << remasked.status();
  EXPECT_THAT(*SuspectNumbers(*other.database->Read()), SizeIs(30));
  const auto of_variant = (*other.database->OpenVariant("with-part"))->Read()->CaptureHistory();
  ASSERT_TRUE(of_variant.ok()) << of_variant.status();
  EXPECT_EQ(of_variant->SerializeAsString(), history.SerializeAsString());
}

TEST_F(CaptureSessionTest, RobotThatNeverSettlesIsLeftOutAndEndsTheSession) {
  cell_.settings.still_images = 2;
  cell_.rig.on_grab = [&](size_t grab, std::vector<CameraImage>& images) {
    std::rotate(images[1].pixels.begin(),
                images[1].pixels.begin() + static_cast<ptrdiff_t>(5 * (grab % 2)),
                images[1].pixels.end());
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(absl::IsAborted(report.status)) << report.status;
  EXPECT_THAT(report.status.message(), HasSubstr("the images of the view 'front' still change"));
  EXPECT_EQ(report.failed, 3u);
  EXPECT_EQ(report.captured, 0u);
  EXPECT_EQ(cell_.robot.stops, 1);
}

TEST_F(CaptureSessionTest, SlowlySettlingRobotIsMeasuredTwice) {
  int measurements = 0;
  cell_.robot.on_state = [&](RobotState& state) {
    // The first measurement is that before the first move.
    if (++measurements == 2) state.positions[1] += 0.01;
    return absl::OkStatus();
  };
  EXPECT_TRUE(cell_.Capture().complete());
}

TEST_F(CaptureSessionTest, MovingRobotEndsTheSession) {
  cell_.robot.on_state = [&](RobotState& state) {
    state.moving = cell_.robot.moves.size() == 3;
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(absl::IsAborted(report.status));
  EXPECT_EQ(report.captured, 2u);
}

TEST_F(CaptureSessionTest, DroppedViewIsAskedForAgain) {
  cell_.rig.on_grab = [](size_t grab, std::vector<CameraImage>&) {
    return grab % 5 == 0 ? absl::UnavailableError("view 'top' gave no image") : absl::OkStatus();
  };
  EXPECT_TRUE(cell_.Capture().complete());
}

TEST_F(CaptureSessionTest, CameraThatIsGoneEndsTheSessionWithWhatIsThere) {
  cell_.rig.on_grab = [](size_t grab, std::vector<CameraImage>&) {
    return grab > 8 ? absl::UnavailableError("view 'top' gave no image") : absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(absl::IsUnavailable(report.status));
  EXPECT_THAT(report.status.message(), HasSubstr("view 'top'"));
  EXPECT_EQ(report.captured, 8u);
  EXPECT_THAT(cell_.Content(), SizeIs(8));
}

TEST_F(CaptureSessionTest, CameraThatRepeatsItsLastImageIsLostUnlessItsViewHasNoNoise) {
  std::vector<uint8_t> last;
  cell_.rig.on_grab = [&](size_t grab, std::vector<CameraImage>& images) {
    if (grab > 8) images[1].pixels = last;
    last = images[1].pixels;
    return absl::OkStatus();
  };
  cell_.settings.noisy_views = {"front"};
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(absl::IsUnavailable(report.status)) << report.status;
  EXPECT_THAT(report.status.message(),
              AllOf(HasSubstr("the camera of the view 'front' is frozen"),
                    HasSubstr("'noise: none' at its view in the cell file")));
  EXPECT_EQ(report.captured, 8u);
  EXPECT_EQ(cell_.robot.stops, 1);
  cell_.settings.noisy_views = {"top"};
  EXPECT_TRUE(cell_.Capture().complete());
}

// With one image a configuration, that of a camera that froze on the way passes for a new one.
TEST_F(CaptureSessionTest, ImageThatIsRepeatedMakesTheConfigurationBeforeSuspect) {
  std::vector<uint8_t> frozen;
  cell_.rig.on_grab = [&](size_t grab, std::vector<CameraImage>& images) {
    if (grab == 9) frozen = images[1].pixels;
    if (grab > 9) images[1].pixels = frozen;
    return absl::OkStatus();
  };
  cell_.settings.noisy_views = {"front"};
  cell_.settings.retry = absl::Milliseconds(100);
  std::string said;
  CaptureObserver observer;
  observer.say = [&](const std::string& line) { said += line + "\n"; };
  const CaptureReport report = cell_.Capture({}, observer);
  EXPECT_TRUE(absl::IsUnavailable(report.status)) << report.status;
  EXPECT_EQ(report.captured, 9u);
  EXPECT_EQ(report.suspect, 1u);
  const ConfigurationNumber before = cell_.travel->Serpentine()[8];
  EXPECT_THAT(*SuspectNumbers(*cell_.database->Read()), ElementsAre(before));
  EXPECT_THAT(said, HasSubstr(absl::StrCat("configuration ", before, " is suspect: the camera")));
}

TEST_F(CaptureSessionTest, ImageThatIsRepeatedIsNoSecondStillImage) {
  cell_.settings.still_images = 2;
  cell_.settings.noisy_views = {"front"};
  const CaptureReport report = cell_.Capture();
  EXPECT_THAT(report.status.message(), HasSubstr("the camera of the view 'front' is frozen"));
  EXPECT_EQ(report.captured, 0u);
}

TEST_F(CaptureSessionTest, ImageOfTheWrongSizeEndsTheSession) {
  cell_.rig.on_grab = [](size_t grab, std::vector<CameraImage>& images) {
    if (grab == 4) images[0] = {.width = 2, .height = 2, .pixels = std::vector<uint8_t>(4)};
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_THAT(report.status.message(), HasSubstr("the view 'top' gave an image of 2 x 2"));
  EXPECT_EQ(report.captured, 3u);
}

TEST_F(CaptureSessionTest, WhatWasCapturedIsWrittenBeforeASlowMove) {
  uint64_t stored = 0;
  cell_.robot.on_move = [&](size_t move) {
    if (move == 2) absl::SleepFor(absl::Milliseconds(60));
    if (move == 4) stored = cell_.database->Read()->size();
    return absl::OkStatus();
  };
  cell_.settings.commit_interval = absl::Milliseconds(50);
  ASSERT_TRUE(cell_.Capture().complete());
  EXPECT_GE(stored, 2u);
}

TEST_F(CaptureSessionTest, ProgressCountsUpToTheEnd) {
  std::vector<uint64_t> progress;
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) { progress.push_back(done); };
  ASSERT_TRUE(cell_.Capture({}, observer).complete());
  ASSERT_THAT(progress, SizeIs(30));
  for (size_t i = 0; i < progress.size(); ++i) EXPECT_EQ(progress[i], i + 1);
}

TEST(CaptureSession, NeedsReferenceImages) {
  FakeCell cell;
  EXPECT_TRUE(absl::IsNotFound(cell.Session().status()));
}

TEST(CaptureSession, NeedsTheDatabasesSegmentation) {
  FakeCell cell;
  cell.TakeReferences();
  const auto session = CaptureSession::Create(*cell.database, *cell.travel, cell.robot, cell.rig,
                                              cell.settings, {.noise_factor = 4});
  EXPECT_TRUE(absl::IsFailedPrecondition(session.status()));
  EXPECT_THAT(session.status().message(), HasSubstr("other segmentation settings"));
}

// Forbidden regions.

class ForbiddenCellTest : public testing::Test {
 protected:
  // A wall from below through the middle of `turn`, and a corner.
  static CaptureSettings Settings() {
    CaptureSettings settings = QuickSettings();
    settings.forbidden_regions = {
        Region("wall", {{"turn", -0.25, 0.25}, {"lift", -1, 0.35}}),
        Region("corner", {{"turn", 0.9, 2}, {"lift", 0.45, 2}}),
    };
    return settings;
  }
  void SetUp() override { cell_.TakeReferences(); }

  // Also between the commanded positions; starts at `from`.
  void ExpectNoRegionTouched(Configuration from) {
    for (const Configuration& to : cell_.Commanded()) {
      EXPECT_EQ(cell_.travel->regions().At(to), std::nullopt);
      EXPECT_EQ(cell_.travel->regions().Between(from, to), std::nullopt)
          << from[0] << ", " << from[1] << " to " << to[0] << ", " << to[1];
      from = to;
    }
  }

  FakeCell cell_{FakeDescription(11, 9), Settings()};
};

TEST_F(ForbiddenCellTest, IsNeverEnteredAndStoredAsExcluded) {
  cell_.robot.at = {0.25, 0.2, -0.7};
  const CaptureReport report = cell_.Capture();
  ASSERT_TRUE(report.complete()) << report.status;
  ExpectNoRegionTouched({-0.7, 0.2});
  const auto content = cell_.Content();
  ASSERT_THAT(content, SizeIs(99));
  uint64_t excluded = 0;
  for (const auto& [number, image] : content) {
    const bool forbidden =
        cell_.travel->regions().At(cell_.database->grid().At(number)).has_value();
    EXPECT_EQ(image.excluded, forbidden);
    EXPECT_THAT(image.masks, SizeIs(forbidden ? 0 : 2));
    if (forbidden) ++excluded;
  }
  EXPECT_EQ(report.excluded, excluded);
  EXPECT_EQ(excluded, 3u * 6u + 1u);
}

TEST_F(ForbiddenCellTest, IsNeverEnteredFromAnywhereNorOnTheWayToHoles) {
  Random random;
  std::uniform_real_distribution<double> turn(-1.5, 1.5);
  std::uniform_real_distribution<double> lift(-0.5, 1);
  cell_.robot.at = {0.25, 0.5, 0};
  ASSERT_TRUE(cell_.Capture().complete());
  const auto all = cell_.Content();
  for (int round = 0; round < 30; ++round) {
    CaptureSelection selection{.kind = CaptureSelection::Kind::kListed};
    for (const auto& [number, image] : all) {
      if (!image.excluded && random() % 10 == 0) selection.listed.push_back(number);
    }
    const Configuration start = {turn(random), lift(random)};
    cell_.robot.at = {0.25, start[1], start[0]};
    cell_.robot.moves.clear();
    const CaptureReport report = cell_.Capture(selection);
    if (cell_.travel->regions().At(start) && !selection.listed.empty()) {
      EXPECT_THAT(report.status.message(), HasSubstr("the robot stands in the forbidden region"));
      EXPECT_TRUE(cell_.robot.moves.empty());
      continue;
    }
    EXPECT_TRUE(report.status.ok()) << report.status;
    EXPECT_EQ(report.captured + report.unreachable, report.planned);
    ExpectNoRegionTouched(start);
  }
  EXPECT_EQ(cell_.Content(), all);
}

TEST_F(ForbiddenCellTest, AfterAWrongPlaceTheWayStartsWhereTheRobotReallyIs) {
  bool lost = false;
  Configuration from = {-0.7, 0.2};
  cell_.robot.at = {0.25, from[1], from[0]};
  cell_.robot.on_move = [&](size_t move) {
    const std::vector<double>& goal = cell_.robot.moves.back();
    const Configuration to = {goal[2], goal[1]};
    EXPECT_EQ(cell_.travel->regions().Between(from, to), std::nullopt);
    from = to;
    lost = move == 20;
    if (lost) from = {0.6, 0.1};  // on the other side of the wall
    return absl::OkStatus();
  };
  cell_.robot.on_state = [&](RobotState& state) {
    if (lost) state.positions = {0.25, 0.1, 0.6};
    return absl::OkStatus();
  };
  const CaptureReport report = cell_.Capture();
  EXPECT_TRUE(report.status.ok()) << report.status;
  EXPECT_EQ(report.failed, 1u);
  EXPECT_EQ(report.captured + 1, report.planned);
}

TEST_F(ForbiddenCellTest, AfterAPauseTheWayStartsWhereSomebodyMovedTheRobotByHand) {
  cell_.settings.sentinels = {.count = 2, .every = absl::ZeroDuration()};
  Configuration from = {-0.7, 0.2};
  cell_.robot.at = {0.25, from[1], from[0]};
  cell_.robot.on_move = [&](size_t) {
    const std::vector<double>& goal = cell_.robot.moves.back();
    const Configuration to = {goal[2], goal[1]};
    EXPECT_EQ(cell_.travel->regions().Between(from, to), std::nullopt);
    from = to;
    return absl::OkStatus();
  };
  bool dark = false;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>& images) {
    for (uint8_t& pixel : images[1].pixels) {
      if (dark) pixel = static_cast<uint8_t>(pixel * 0.7);
    }
    return absl::OkStatus();
  };
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) { dark = done == 12; };
  int asked = 0;
  observer.alarm = [&](const std::string&) {
    ++asked;
    dark = false;
    from = {0.6, 0};
    cell_.robot.at = {0.25, from[1], from[0]};
    return AfterAlarm::kCheckAgain;
  };
  const CaptureReport report = cell_.Capture({}, observer);
  EXPECT_TRUE(report.complete()) << report.status << report.alarm;
  EXPECT_EQ(asked, 1);
}

TEST_F(ForbiddenCellTest, StopEndsTheSessionBeforeTheNextMoveOfADetour) {
  cell_.robot.at = {0.25, 0.2, -0.7};
  ASSERT_TRUE(cell_.Capture().status.ok());
  cell_.robot.at = {0.25, 0.2, -0.7};
  cell_.robot.moves.clear();
  CaptureObserver observer;
  observer.stop_requested = [&] { return !cell_.robot.moves.empty(); };
  const auto beyond = cell_.database->grid().Nearest(Configuration{0.6, 0});
  const CaptureReport report =
      cell_.Capture({.kind = CaptureSelection::Kind::kListed, .listed = {*beyond}}, observer);
  EXPECT_TRUE(report.stopped) << report.status;
  EXPECT_EQ(report.captured, 0u);
  EXPECT_THAT(cell_.robot.moves, SizeIs(1));
}

TEST(CaptureSession, ConfigurationsBehindARegionAreLeftOutAndCounted) {
  CaptureSettings settings = QuickSettings();
  settings.forbidden_regions = {Region("wall", {{"turn", -0.05, 0.05}})};  // between grid values
  FakeCell cell(FakeDescription(), settings);
  cell.TakeReferences();
  cell.robot.at = {0.25, 0, -1};
  std::vector<std::string> said;
  CaptureObserver observer;
  observer.say = [&](const std::string& line) { said.push_back(line); };
  EXPECT_EQ(cell.Plan()->parts, 2);
  const CaptureReport report = cell.Capture({}, observer);
  EXPECT_TRUE(report.status.ok()) << report.status;
  EXPECT_FALSE(report.complete());
  EXPECT_EQ(report.captured, 15u);
  EXPECT_EQ(report.unreachable, 15u);
  ASSERT_THAT(said, SizeIs(1));
  EXPECT_THAT(said[0], HasSubstr("no way around the forbidden region 'wall'"));
  for (const Configuration& commanded : cell.Commanded()) EXPECT_LT(commanded[0], 0);
  // Somebody moves the robot into the other part.
  cell.robot.at = {0.25, 0, 1};
  const CaptureReport other = cell.Capture({}, observer);
  EXPECT_TRUE(other.status.ok()) << other.status;
  EXPECT_EQ(other.alarm, "");
  EXPECT_EQ(other.captured, 15u);
}

}  // namespace
}  // namespace silhouette
