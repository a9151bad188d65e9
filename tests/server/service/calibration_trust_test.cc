// SPDX-License-Identifier: Apache-2.0
// A calibration that is checked: while it is not known to hold, nothing that rests on it is free,
// whichever way one asks; what does not rest on it is served as before.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/server/service/raw_call.h"
#include "tests/server/service/test_server.h"
#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

struct CalibrationTrustTest : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = NewDatabase({.calibration = TestCalibration()});
  TestServer server{database, Settings(Holding())};

  CalibrationTrust Holding() const {
    CalibrationTrust trust;
    trust.holds = true;
    trust.fingerprint = database->calibration_fingerprint();
    trust.message = "no view moved";
    trust.views = {"left", "right", "top"};
    return trust;
  }
  CalibrationTrust Drifted() const {
    CalibrationTrust trust = Holding();
    trust.holds = false;
    trust.message = "view 'left' moved by 12 px";
    return trust;
  }
  static ServingSettings Settings(const CalibrationTrust& trust) {
    ServingSettings settings;
    settings.policy.preset = Preset::kCalibrated;
    settings.trust = std::make_shared<const CalibrationTrust>(trust);
    return settings;
  }
  void Tell(const CalibrationTrust& trust) {
    server.server->SetTrust(std::make_shared<const CalibrationTrust>(trust));
  }
  v1::CalibrationCheck Told() {
    const v1::GetDatabaseResponse response = server.GetDatabase();
    EXPECT_TRUE(response.has_calibration_check());
    return response.calibration_check();
  }

  // Waits until the health service says so of the calibration.
  void AwaitHealth(bool serving) {
    const std::string wanted = serving ? "\x08\x01" : "\x08\x02";
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    std::string said;
    while (said != wanted && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      said = HealthOf(server.channel, "silhouette.v1.Calibration");
    }
    EXPECT_EQ(said, wanted);
  }

  static v1::Policy Uncalibrated() { return PolicyNamed("uncalibrated"); }

  // Under the default policy, in every way that one can ask.
  void ExpectOnlyDoubt() {
    constexpr auto kDoubt = v1::Verdict::REASON_CALIBRATION_DOUBTFUL;
    for (int a = 0; a < 5; ++a) {
      const v1::Verdict verdict = server.CheckOne(At(a, 0));
      EXPECT_EQ(verdict.state(), v1::Verdict::STATE_UNKNOWN);
      EXPECT_EQ(verdict.reason(), kDoubt);
    }
    EXPECT_EQ(server.Path({At(0, 0), At(1, 0)}).verdict().reason(), kDoubt);
    EXPECT_EQ(server.Path({At(0, 0), At(1, 0)}, true).verdict().reason(), kDoubt);
    EXPECT_EQ(server.Explain(At(1, 0)).verdict().reason(), kDoubt);
    EXPECT_EQ(server.CheckNumbers({0, 1, 2}).unknown_reason(), kDoubt);
    EXPECT_EQ(server.CheckNumbers({0, 1, 2}).free(), std::string(1, '\0'));
    const auto space = server.Space();
    ASSERT_EQ(space.size(), 1u);
    EXPECT_EQ(space[0].unknown_reason(), kDoubt);
    EXPECT_EQ(space[0].tiles_size(), 0);
    EXPECT_EQ(server.CheckOne(At(1, 0), Uncalibrated()).state(), v1::Verdict::STATE_FREE);
    EXPECT_FALSE(Told().holds());
  }

  // The same, and why, in GetDatabase and in the defects of a verdict.
  void ExpectDoubt(const CalibrationTrust& trust, const std::string& why) {
    Tell(trust);
    ExpectOnlyDoubt();
    EXPECT_EQ(Told().message(), why);
    const auto defects = server.Explain(At(1, 0)).basis().defects();
    ASSERT_EQ(defects.size(), 1);
    EXPECT_EQ(defects[0].message(), "the calibration is not confirmed: " + why);
  }
};

TEST_F(CalibrationTrustTest, ThatHoldsIsServed) {
  server.Publish(EmptyCellScene());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  EXPECT_TRUE(Told().holds());
}

TEST_F(CalibrationTrustTest, ThatIsNotCheckedIsServedAndSaysNothing) {
  server.server->SetTrust(nullptr);
  server.Publish(EmptyCellScene());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  const v1::GetDatabaseResponse response = server.GetDatabase();
  EXPECT_FALSE(response.has_calibration_check());
}

TEST_F(CalibrationTrustTest, ACameraThatMovedIsNeverFree) {
  server.Publish(EmptyCellScene());
  Tell(Drifted());
  ExpectOnlyDoubt();
  EXPECT_EQ(Told().message(), "view 'left' moved by 12 px");
  Tell(Holding());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
}

TEST_F(CalibrationTrustTest, ACheckOfAnotherCalibrationIsNeverFree) {
  server.Publish(EmptyCellScene());
  CalibrationTrust trust = Holding();
  trust.fingerprint = "0000000000000000";
  Tell(trust);
  ExpectOnlyDoubt();
  EXPECT_EQ(Told().message(),
            absl::StrCat("the check is of another calibration, 0000000000000000, than the database "
                         "has, ",
                         database->calibration_fingerprint(),
                         "; run 'silhouette-calibrate check' again with this database"));
  trust.fingerprint.clear();
  Tell(trust);
  ExpectOnlyDoubt();
}

TEST_F(CalibrationTrustTest, ACheckThatIsTooOldIsNeverFree) {
  CalibrationTrust trust = Holding();
  trust.until = absl::Seconds(10);
  Tell(trust);
  server.clock.Advance(absl::Milliseconds(9'999));
  server.Publish(EmptyCellScene());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  server.clock.Advance(absl::Milliseconds(1));
  ExpectOnlyDoubt();
}

TEST_F(CalibrationTrustTest, ACheckThatIsTooOldSaysHowOld) {
  CalibrationTrust trust = Holding();
  trust.until = absl::Milliseconds(500);
  trust.max_age = absl::Seconds(6);
  server.clock.Advance(absl::Milliseconds(750));
  server.Publish(EmptyCellScene());
  ExpectDoubt(trust,
              "the check is 6.25 s old; calibration_check: max_age is 6 s; run "
              "'silhouette-calibrate check' again");
}

TEST_F(CalibrationTrustTest, ACheckThatDoesNotHaveEachViewOnceIsNeverFree) {
  server.Publish(EmptyCellScene());
  CalibrationTrust trust = Holding();
  trust.views = {"top", "left"};
  ExpectDoubt(trust, "the check lacks view 'right'; run 'silhouette-calibrate check' again");
  trust.views = {"top", "left", "top"};
  ExpectDoubt(trust, "the check lacks view 'right'; run 'silhouette-calibrate check' again");
  trust.views = {"top", "left", "right", "top"};
  ExpectDoubt(trust,
              "the check has view 'top' more than once; run 'silhouette-calibrate check' again");
  trust.views = {"top", "left", "right", "rear"};
  ExpectDoubt(trust,
              "the check has view 'rear', which the database does not have; run "
              "'silhouette-calibrate check' again");
  Tell(Holding());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
}

TEST_F(CalibrationTrustTest, ACheckIsOfTheViewsOfTheDatabaseThatIsServedNow) {
  storage::v1::CellDescription renamed = ServerTestCell();
  renamed.mutable_views(0)->set_name("rear");
  server.server->ReplaceDatabase(NewDatabase({.cell = renamed, .calibration = TestCalibration()}));
  ASSERT_EQ(server.GetDatabase().calibration_check().message(),
            "the check lacks view 'rear'; run 'silhouette-calibrate check' again");
  CalibrationTrust trust = Holding();
  std::ranges::replace(trust.views, std::string(kViewNames[0]), std::string("rear"));
  Tell(trust);
  EXPECT_TRUE(Told().holds());
}

TEST_F(CalibrationTrustTest, ACheckThatLetViewsMoveByMoreThanTheMarginIsNeverFree) {
  server.Publish(EmptyCellScene());
  CalibrationTrust trust = Holding();
  trust.limit = 100;
  ExpectDoubt(trust,
              "the check let views move by 100.00 mask px, more than calibration: margin, 0.00; "
              "run 'silhouette-calibrate check' again with a smaller --limit");
}

TEST_F(CalibrationTrustTest, ItsHealthFollowsTheCheckTheTimeAndTheDatabase) {
  EXPECT_EQ(HealthOf(server.channel, "silhouette.v1.Calibration"), "\x08\x01") << "at once";
  Tell(Drifted());
  AwaitHealth(false);
  CalibrationTrust trust = Holding();
  trust.until = absl::Seconds(10);
  Tell(trust);
  AwaitHealth(true);
  server.clock.Advance(absl::Seconds(10));
  AwaitHealth(false);
  Tell(Holding());
  AwaitHealth(true);
  server.server->ReplaceDatabase(NewDatabase());
  AwaitHealth(false);
}

TEST_F(CalibrationTrustTest, OneThatTheRobotImagesContradictIsNeverFreeWhateverChecksSay) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.calibration = TestCalibration()});
  LoadSettings load;
  load.calibration_doubt = "the robot is elsewhere in view 'left'";
  server.server->ReplaceDatabase(LoadDatabase(folder / "db", {.margin = 0}, {}, load));
  server.Publish(EmptyCellScene());
  for (const bool checked : {true, false}) {
    if (!checked) server.server->SetTrust(nullptr);
    ExpectOnlyDoubt();
    EXPECT_EQ(Told().message(), load.calibration_doubt);
    AwaitHealth(false);
  }
  server.server->ReplaceDatabase(database);
  server.Publish(EmptyCellScene());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
}

TEST_F(CalibrationTrustTest, WhatWatchersWereToldIsTakenBack) {
  server.Publish(EmptyCellScene());
  SpaceWatching watching(server);
  SpaceUpdate update = watching.Next();
  while (update.first.unknown_reason() != v1::Verdict::REASON_UNSPECIFIED) update = watching.Next();
  EXPECT_GT(update.tiles, 0u);
  Tell(Drifted());
  update = watching.Next();
  EXPECT_EQ(update.first.unknown_reason(), v1::Verdict::REASON_CALIBRATION_DOUBTFUL);
  EXPECT_EQ(update.first.basis().valid_for().seconds(), 0);
  EXPECT_EQ(update.first.basis().valid_for().nanos(), 0);
  Tell(Holding());
  update = watching.Next();
  EXPECT_EQ(update.first.unknown_reason(), v1::Verdict::REASON_UNSPECIFIED);
}

TEST_F(CalibrationTrustTest, VerdictsAreValidNoLongerThanTheCheck) {
  CalibrationTrust trust = Holding();
  trust.until = absl::Milliseconds(300);
  Tell(trust);
  server.Publish(EmptyCellScene());
  SpaceWatching watching(server);
  SpaceUpdate update = watching.Next();
  while (update.first.unknown_reason() != v1::Verdict::REASON_UNSPECIFIED) update = watching.Next();
  EXPECT_EQ(update.first.basis().valid_for().nanos(), 300'000'000);
}

}  // namespace
}  // namespace silhouette
