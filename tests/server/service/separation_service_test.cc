// SPDX-License-Identifier: Apache-2.0
// Speed and separation over the API.
#include <gmock/gmock.h>
#include <pthread.h>

#include <array>
#include <atomic>
#include <cmath>
#include <string>
#include <thread>

#include "silhouette/client.h"
#include "tests/server/drawn_cell.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

std::shared_ptr<const ServedDatabase> SeparatingDatabase(bool with_separation) {
  const auto model = std::make_shared<const RobotModel>(DrawnModel());
  SoundCell sound{.settings = {.least_obstacle = 0.2, .voxel_edge = 0.05, .model_tolerance = 0.005},
                  .workspace = Eigen::AlignedBox3d(Eigen::Vector3d(-1.1, -1.1, 0),
                                                   Eigen::Vector3d(1.1, 1.1, 1.8)),
                  .payload_radius = 0,
                  .robot = model};
  if (with_separation) {
    sound.separation = SeparationCell{
        .settings = {},
        .zone = Eigen::AlignedBox3d(Eigen::Vector3d(-1.3, -1.3, 0), Eigen::Vector3d(1.3, 1.3, 2)),
        .voxel_edge = 0.06,
        .unseen_is_empty = true};
    sound.separation->settings.levels = {{"slow", 0.25, 0.05, 0.01}, {"fast", 1, 0.3, 0.2}};
  }
  const auto created = Database::Create(FreshFolder() / "db", DrawnCellDescription());
  EXPECT_TRUE(created.ok()) << created.status();
  auto served = ServedDatabase::Load(
      **created, {.margin = 0}, {}, sound,
      {.calibration = DrawnCalibration(), .drawn = DrawnCell{.robot = model, .parts = {}}});
  EXPECT_TRUE(served.ok()) << served.status();
  return *std::move(served);
}

struct SeparationServiceTest : ::testing::Test {
  // Somebody on the far side of the beam at turn 2, twice: so that a time between scenes is known.
  void Publish(const std::vector<DrawnCellBall>& people = {{{1.0, 0, 0.9}, 0.15}}) {
    for (int i = 0; i < 2; ++i) {
      server.Publish(DrawnSceneInput(*database->robot_images().drawn(), {2, 0}, people));
    }
  }

  absl::StatusOr<client::PathCheck> Ask(const std::vector<Configuration>& path,
                                        const client::SeparationPolicy& policy = {}) {
    const auto client = client::Client::Connect(server.server->address());
    if (!client.ok()) return client.status();
    return client->CheckPath(path, {}, client::Clearance::kOmit, {}, policy);
  }

  // That may be gone by for half a second.
  void PublishAtIntervals() {
    Publish();
    server.clock.Advance(absl::Milliseconds(400));
    Publish();
  }

  // Of a path whose levels keep hardly a distance.
  v1::CheckPathResponse AskAway() {
    v1::CheckPathRequest request;
    Set({2.6, 0}, request.add_waypoints());
    Set({2.7, 0}, request.add_waypoints());
    request.mutable_separation()->set_human_speed(0.01);
    request.mutable_separation()->set_near_human_speed(0.01);
    return server.Ask(&v1::CollisionService::Stub::CheckPath, request);
  }

  void AllowEverywhere(absl::Duration duration) {
    v1::AllowRegionRequest request = RegionAt("part", 0, duration);
    request.clear_views();
    for (const auto& view : database->cell().views()) {
      v1::RegionPixels& pixels = *request.add_views();
      pixels.set_view(view.name());
      Set(~Mask(kDrawnSize), pixels.mutable_mask());
    }
    server.Ask(&v1::SceneService::Stub::AllowRegion, request);
  }
  void Revoke() {
    v1::RevokeRegionRequest request;
    request.set_name("part");
    server.Ask(&v1::SceneService::Stub::RevokeRegion, request);
  }

  // In the thread of a check, when it looks at the clock for the n-th time.
  void AtLook(int n, std::function<void()> action) {
    at_look = std::move(action);
    looks_left = n;
  }
  bool InACheck() {
    std::array<char, 16> name{};
    pthread_getname_np(pthread_self(), name.data(), name.size());
    return std::string(name.data()) == "checks";
  }

  std::function<void()> at_look;
  std::atomic<int> looks_left = 0;
  std::atomic<int> looks = 0;  // in checks
  std::shared_ptr<const ServedDatabase> database = SeparatingDatabase(true);
  TestServer server{database, {}, [this](const Clock& inner) {
                      return [this, inner] {
                        if (InACheck()) {
                          ++looks;
                          if (--looks_left == 0) at_look();
                        }
                        return inner();
                      };
                    }};
};

TEST_F(SeparationServiceTest, APathTowardsSomebodyKeepsLessDistanceThanOneAway) {
  Publish();
  const auto far = Ask({{2.6, 0}, {3, 0}}, {.reaction_time = 0.0});
  ASSERT_TRUE(far.ok()) << far.status();
  ASSERT_TRUE(far->separation);
  EXPECT_EQ(far->separation->unknown_reason, client::Reason::kUnspecified);
  const auto near = Ask({{2.6, 0}, {0.9, 0}}, {.reaction_time = 0.0});
  ASSERT_TRUE(near.ok() && near->separation) << near.status();
  EXPECT_GT(far->separation->distance, near->separation->distance + 0.2);
  EXPECT_FALSE(near->separation->leads_away);
  EXPECT_GT(near->separation->fraction, 0.8);
  const auto away = Ask({{0.9, 0}, {2.6, 0}});
  ASSERT_TRUE(away.ok() && away->separation) << away.status();
  EXPECT_TRUE(away->separation->leads_away);
  const auto and_back = Ask({{0.9, 0}, {2.6, 0}, {0.5, 0}});
  ASSERT_TRUE(and_back.ok() && and_back->separation) << and_back.status();
  EXPECT_FALSE(and_back->separation->leads_away);
  const auto beginning = Ask({{0.9, 0}, {2.6, 0}, {0.5, 0}}, {.horizon = 0});
  ASSERT_TRUE(beginning.ok() && beginning->separation) << beginning.status();
  EXPECT_FALSE(beginning->separation->leads_away) << "the end was not looked at";
}

TEST_F(SeparationServiceTest, ReactionCountsTheAgeOfTheImageUntilTheNextReply) {
  Publish();
  const auto path = Ask({{2.9, 0}, {3, 0}}, {.human_speed = 1.6, .near_human_speed = 1.6});
  ASSERT_TRUE(path.ok() && path->separation) << path.status();
  const client::Separation& told = *path->separation;
  ASSERT_EQ(told.protective_distances.size(), 2u);
  const double reaction = absl::ToDoubleSeconds(told.image_age) + 0.1;
  EXPECT_NEAR(told.protective_distances[1], 1.6 * (reaction + 0.3), 1e-9);
  EXPECT_EQ(told.LevelNow() == told.level, client::RunningClock::now() < told.valid_until);
}

TEST_F(SeparationServiceTest, WithoutADirectionWhatTheRobotMovesUntilItStandsCounts) {
  Publish();
  const auto place = Ask({{3, 0}}, {.human_speed = 1.6, .near_human_speed = 1.6});
  ASSERT_TRUE(place.ok() && place->separation) << place.status();
  const client::Separation& told = *place->separation;
  ASSERT_EQ(told.protective_distances.size(), 2u);
  const double reaction = absl::ToDoubleSeconds(told.image_age) + 0.1;
  EXPECT_NEAR(told.protective_distances[1], 1.6 * (reaction + 0.3) + 1.0 * reaction + 0.2, 1e-9);
}

TEST_F(SeparationServiceTest, ARobotThatStaysKeepsTheDistanceOfOnePlace) {
  Publish();
  const auto place = Ask({{0.9, 0}});
  const auto path = Ask({{0.9, 0}, {0.9, 0}, {0.9, 0}});
  ASSERT_TRUE(path.ok() && path->separation && place.ok() && place->separation) << path.status();
  EXPECT_EQ(path->separation->level, place->separation->level);
  EXPECT_EQ(path->separation->distance, place->separation->distance);
}

TEST_F(SeparationServiceTest, NoPathIsKnownToLeadAwayFromWhereNoDistanceIsKnown) {
  Publish();
  for (const Configuration& end : {Configuration{-0.1, 0}, Configuration{1.5, 0}}) {
    const auto path = Ask({{0.1, 0}, end});
    ASSERT_TRUE(path.ok() && path->separation) << path.status();
    EXPECT_EQ(path->separation->distance, 0);
    EXPECT_FALSE(path->separation->leads_away);
  }
}

// Somebody who stands beside the beam and whose forearm, thinner than the least obstacle, lies
// along it, where the beam hides it in some views.
TEST_F(SeparationServiceTest, NoPathIsKnownToLeadAwayFromAnArmThatTouchesTheRobot) {
  constexpr double kArm = 0.03;
  constexpr double kTouching = 0.06 + kArm;  // from the beam's axis
  const Configuration now = {2, 0};
  const Eigen::Vector3d along(std::cos(now[0]), std::sin(now[0]), 0);
  const Eigen::Vector3d beside = Eigen::Vector3d::UnitZ().cross(along);
  int too_far = 0;
  for (const double angle : {-2.6, -2.4, -2.2}) {
    const Eigen::Vector3d out =
        std::cos(angle) * beside + std::sin(angle) * Eigen::Vector3d::UnitZ();
    const auto at = [&](double on_beam, double away) -> Eigen::Vector3d {
      return Eigen::Vector3d(0, 0, 0.8) + on_beam * along + away * out;
    };
    constexpr double kElbow = 0.65;
    std::vector<DrawnCellBall> somebody = {{at(kElbow, 0.8), 0.25}};
    for (double away = kTouching; away < 0.6; away += kArm) {
      somebody.push_back({at(kElbow, away), kArm});
    }
    for (double on = -0.2; on < 0.2; on += kArm) {
      somebody.push_back({at(kElbow + on, kTouching), kArm});
    }
    Publish(somebody);
    for (const double turn : {-0.2, 0.2}) {
      const auto path = Ask({now, {now[0] + turn, 0}});
      ASSERT_TRUE(path.ok() && path->separation) << path.status();
      too_far += path->separation->distance > 0.05 ? 1 : 0;
      EXPECT_FALSE(path->separation->leads_away) << angle << " " << turn;
    }
  }
  EXPECT_GT(too_far, 0) << "no scene tells";
}

// The path comes nearer and nearer: what the level moves until it stands decides.
TEST_F(SeparationServiceTest, TheHorizonGoesOnUntilTheRobotStands) {
  Publish();
  const std::vector<Configuration> path = {{1.3, 0}, {0.7, 0}};
  const auto distance = [&](double stopping_distance, std::optional<double> horizon) {
    const auto told = Ask(path, {.human_speed = 0.01,
                                 .near_human_speed = 0.01,
                                 .reaction_time = 0.0,
                                 .levels = {{"slow", 0.001, 0, stopping_distance}},
                                 .horizon = horizon});
    EXPECT_TRUE(told.ok() && told->separation) << told.status();
    return told.ok() && told->separation ? told->separation->distance : 0;
  };
  const double until_it_stands = distance(0.4, 0);
  EXPECT_GT(distance(0, 0), until_it_stands + 0.05);
  EXPECT_NEAR(distance(0, 0.4), until_it_stands, 0.01);
  EXPECT_LT(distance(0, std::nullopt), until_it_stands - 0.05);
}

TEST_F(SeparationServiceTest, AFasterLevelNeedsAllSlowerOnes) {
  Publish();
  // The first level stops too late, though the second would not.
  const auto path =
      Ask({{2.6, 0}, {0.9, 0}}, {.levels = {{"late", 0.01, 5, 0}, {"b", 0.02, 0, 0}}});
  ASSERT_TRUE(path.ok() && path->separation) << path.status();
  EXPECT_EQ(path->separation->level, 0);
}

TEST_F(SeparationServiceTest, WithoutASceneTheRobotStopsWithTheReason) {
  const auto path = Ask({{3, 0}});
  ASSERT_TRUE(path.ok() && path->separation) << path.status();
  EXPECT_EQ(path->separation->level, 0);
  EXPECT_EQ(path->separation->LevelNow(), 0);
  EXPECT_EQ(path->separation->unknown_reason, client::Reason::kNoScene);
}

TEST_F(SeparationServiceTest, AReplyIsNotGoneByWhenItIsOld) {
  Publish();
  auto path = Ask({{3, 0}}, {.human_speed = 0.01, .near_human_speed = 0.01, .reaction_time = 0.0});
  ASSERT_TRUE(path.ok() && path->separation) << path.status();
  EXPECT_GT(path->separation->level, 0);
  path->separation->leads_away = true;
  std::this_thread::sleep_until(path->separation->valid_until);
  EXPECT_EQ(path->separation->LevelNow(), 0);
  EXPECT_FALSE(path->separation->LeadsAwayNow());
}

TEST_F(SeparationServiceTest, NoLevelOutlastsTheRegionThatItRestsOn) {
  PublishAtIntervals();
  const auto valid_for = [&] { return AskAway().separation().valid_for().nanos(); };
  EXPECT_EQ(valid_for(), 500'000'000);
  AllowEverywhere(absl::Milliseconds(100));
  EXPECT_EQ(valid_for(), 100'000'000);
}

TEST_F(SeparationServiceTest, NoLevelOutlastsTheCheckOfTheCalibrationThatItRestsOn) {
  PublishAtIntervals();
  CalibrationTrust trust;
  trust.holds = true;
  trust.fingerprint = database->calibration_fingerprint();
  for (int view = 0; view < database->views(); ++view) {
    trust.views.push_back(database->view_name(view));
  }
  trust.until = server.clock.clock()().running + absl::Milliseconds(100);
  server.server->SetTrust(std::make_shared<const CalibrationTrust>(trust));
  EXPECT_EQ(AskAway().separation().valid_for().nanos(), 100'000'000);
}

TEST_F(SeparationServiceTest, WhatEndsAVerdictWhileItIsMadeEndsItsLevel) {
  int ended = 0;
  for (int look = 1; look < 8; ++look) {
    PublishAtIntervals();
    AllowEverywhere(absl::Seconds(10));
    EXPECT_EQ(AskAway().separation().level(), 2);
    AtLook(look, [this] { Revoke(); });
    const v1::CheckPathResponse path = AskAway();
    looks_left = 0;
    if (path.verdict().reason() != v1::Verdict::REASON_REGION_ENDED) continue;
    ++ended;
    EXPECT_EQ(path.separation().level(), 0) << "at look " << look;
    EXPECT_EQ(path.separation().unknown_reason(), path.verdict().reason());
    EXPECT_EQ(path.separation().valid_for().nanos(), 0);
  }
  EXPECT_GT(ended, 1);
}

TEST_F(SeparationServiceTest, NoLevelOutlastsItsImagesHoweverLongTheAnswerTakes) {
  int late = 0;
  for (int look = 1; look < 8; ++look) {
    PublishAtIntervals();
    AtLook(look, [this] { server.clock.Advance(absl::Milliseconds(100)); });
    const v1::CheckPathResponse path = AskAway();
    looks_left = 0;
    const double age = absl::ToDoubleSeconds(DurationFrom(path.basis().scene_age()));
    const double valid_for = absl::ToDoubleSeconds(DurationFrom(path.separation().valid_for()));
    if (age > 0.05) ++late;
    EXPECT_EQ(path.separation().nearest().configuration().positions_size(), 2);
    EXPECT_LE(valid_for, path.separation().image_age() - age + 1e-6) << "at look " << look;
  }
  EXPECT_GT(late, 1);
}

TEST_F(SeparationServiceTest, TheClockIsReadThoughChecksHoldAllWorkers) {
  Publish();
  server.Check({}, PolicyNamed("sound"));
  EXPECT_EQ(looks, 0);
  server.CheckOne({3, 0}, PolicyNamed("sound"));
  EXPECT_GT(looks, 0);
}

TEST_F(SeparationServiceTest, LevelsOfTheRequestReplaceThoseOfTheCell) {
  Publish();
  const auto path = Ask({{3, 0}}, {.levels = {{"crawl", 0.01, 0, 0}}, .horizon = 0.2});
  ASSERT_TRUE(path.ok() && path->separation) << path.status();
  EXPECT_EQ(path->separation->protective_distances.size(), 1u);
}

TEST_F(SeparationServiceTest, WhatCannotBeIsRefused) {
  Publish();
  const auto refused = [&](const client::SeparationPolicy& policy, const std::string& field) {
    const auto path = Ask({{3, 0}}, policy);
    EXPECT_EQ(path.status().code(), absl::StatusCode::kInvalidArgument) << field;
    EXPECT_THAT(std::string(path.status().message()), HasSubstr(field));
  };
  refused({.human_speed = -1}, "human_speed");
  refused({.reaction_time = NAN}, "reaction_time");
  refused({.levels = {{"a", 2, 0, 0}, {"b", 1, 0, 0}}}, "levels");
  refused({.levels = std::vector<client::SpeedLevel>(17, {"a", 1, 0, 0})}, "levels");
  refused({.horizon = -0.1}, "horizon");
}

TEST_F(SeparationServiceTest, EndlessPathsAreRefused) {
  Publish({});
  EXPECT_EQ(Ask({{2.9, 0}, {1e5, 0}}).status().code(), absl::StatusCode::kResourceExhausted);
  const auto beginning = Ask({{2.9, 0}, {1e5, 0}}, {.horizon = 0.1});
  ASSERT_TRUE(beginning.ok() && beginning->separation) << beginning.status();
  EXPECT_GT(beginning->separation->distance, 0);
}

TEST_F(SeparationServiceTest, NothingIsKnownOfAPathBeyondTheJointsLimits) {
  Publish({});
  for (double beyond : {2.1, 1e5, 1e300}) {
    const auto path = Ask({{2.9, 0}, {2.9, beyond}});
    ASSERT_TRUE(path.ok() && path->separation) << path.status();
    EXPECT_EQ(path->separation->level, 0);
    EXPECT_EQ(path->separation->unknown_reason, client::Reason::kOutsideGrid);
  }
}

TEST_F(SeparationServiceTest, AWatchTellsItWithEveryScene) {
  Publish();
  v1::CheckPathRequest request;
  Set({3, 0}, request.add_waypoints());
  request.mutable_separation();
  grpc::ClientContext context;
  const auto reader = server.collision->WatchPath(&context, request);
  v1::WatchPathResponse response;
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_GT(response.check().separation().distance(), 0);
  Publish();
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_GT(response.check().separation().distance(), 0);
  context.TryCancel();
}

TEST(SeparationService, CellsWithoutItSayWhatIsMissing) {
  TestServer server{SeparatingDatabase(false)};
  const auto client = client::Client::Connect(server.server->address());
  ASSERT_TRUE(client.ok()) << client.status();
  const auto path = client->CheckPath(std::vector<Configuration>{{3, 0}}, {},
                                      client::Clearance::kOmit, {}, client::SeparationPolicy{});
  EXPECT_EQ(path.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(path.status().message()), HasSubstr("the sections 'sound' and"));
}

}  // namespace
}  // namespace silhouette
