// SPDX-License-Identifier: Apache-2.0
// LocalSpace of a robot whose images are drawn, against the server itself.
#include "clients/cpp/drawn_space.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <thread>

#include "clients/cpp/space_assembly.h"
#include "silhouette/client.h"
#include "silhouette/local_space.h"
#include "tests/random.h"
#include "tests/server/drawn_cell.h"
#include "tests/server/service/test_server.h"

namespace silhouette::client {
namespace {

using ::testing::HasSubstr;

using DrawnUpdate = v1::WatchConfigurationSpaceResponse;

constexpr absl::Duration kDrawnSpaceLong = absl::Seconds(20);

double AnyNumber(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

std::shared_ptr<const ServedDatabase> DrawnSpaceDatabase(JointRegions forbidden = {},
                                                         double payload_radius = 0,
                                                         double margin = 0) {
  const std::filesystem::path folder = FreshFolder();
  const auto created = Database::Create(folder / "db", DrawnCellDescription());
  EXPECT_TRUE(created.ok()) << created.status();
  auto served = ServedDatabase::Load(
      **created, {.margin = margin}, {}, std::nullopt,
      {.calibration = DrawnCalibration(),
       .drawn = DrawnCell{.robot = std::make_shared<const RobotModel>(DrawnModel()),
                          .parts = {},
                          .payload_radius = payload_radius,
                          .forbidden = std::move(forbidden)}});
  EXPECT_TRUE(served.ok()) << served.status();
  return *std::move(served);
}

// A server whose clock runs, with scenes of balls.
struct DrawnServer {
  explicit DrawnServer(std::shared_ptr<const ServedDatabase> the_database = DrawnSpaceDatabase(),
                       absl::Duration max_age = absl::Minutes(10))
      : database(std::move(the_database)),
        server(database, Settings(max_age), [](const silhouette::Clock&) { return SystemClock; }) {}

  static ServingSettings Settings(absl::Duration max_age) {
    ServingSettings settings;
    settings.scene.max_age = max_age;
    return settings;
  }
  Client client() const { return Client::Connect(server.server->address()).value(); }

  // Returns the scene's number. `missing`: a view that does not come.
  uint64_t Publish(Random& random, int balls, int missing = -1) {
    std::vector<DrawnCellBall> places;
    for (int i = 0; i < balls; ++i) {
      places.push_back({{AnyNumber(random, -0.9, 0.9), AnyNumber(random, -0.9, 0.9),
                         AnyNumber(random, 0.1, 1.4)},
                        AnyNumber(random, 0.02, 0.2)});
    }
    SceneInput input =
        DrawnSceneInput(*database->robot_images().drawn(),
                        {AnyNumber(random, 1.2, 3), AnyNumber(random, -1.9, 1.9)}, places);
    if (missing >= 0) input.views.erase(input.views.begin() + missing);
    return server.Publish(input).id();
  }

  std::shared_ptr<const ServedDatabase> database;
  TestServer server;
};

LocalSpaceOptions WithPolicy(const Policy& policy) {
  return {.policy = policy, .max_age = absl::Minutes(5)};
}

// The snapshot of a scene.
std::shared_ptr<const SpaceSnapshot> SnapshotOfScene(const LocalSpace& space, uint64_t scene) {
  auto snapshot = space.Snapshot();
  for (int i = 0; i < 100 && (snapshot->basis().scene_id != scene || snapshot->unknown_reason());
       ++i) {
    snapshot = space.WaitForUpdate(snapshot->number(), kDrawnSpaceLong / 20);
  }
  EXPECT_EQ(snapshot->basis().scene_id, scene) << space.status().problem;
  EXPECT_EQ(snapshot->unknown_reason(), std::nullopt) << space.status().problem;
  return snapshot;
}

Configuration AnyPlace(Random& random) {
  return {AnyNumber(random, -4, 4), AnyNumber(random, -2.05, 2.05)};
}

// How often each state was found.
struct Found {
  int free = 0;
  int occupied = 0;
  int unknown = 0;

  void Add(State state) {
    ++(state == State::kFree ? free : state == State::kOccupied ? occupied : unknown);
  }
};

Found ExpectSameChecks(const SpaceSnapshot& here, const Client& client, const Policy& policy,
                       int count, Random& random) {
  Found found;
  std::vector<Configuration> places;
  for (int i = 0; i < count; ++i) places.push_back(AnyPlace(random));
  const auto there = client.CheckConfigurations(places, policy, Evidence::kOmit);
  EXPECT_TRUE(there.ok()) << there.status();
  EXPECT_EQ(there->basis.scene_id, here.basis().scene_id);
  EXPECT_EQ(there->basis.unverified_model, here.basis().unverified_model);
  const ConfigurationChecks checks = here.CheckConfigurations(places);
  for (size_t i = 0; i < places.size(); ++i) {
    const Verdict& verdict = checks.verdicts[i];
    found.Add(verdict.state);
    if (verdict.state != there->verdicts[i].state || verdict.reason != there->verdicts[i].reason) {
      ADD_FAILURE() << places[i][0] << ", " << places[i][1] << ": " << NameOf(verdict.state) << " "
                    << NameOf(verdict.reason) << " here, " << NameOf(there->verdicts[i].state)
                    << " " << NameOf(there->verdicts[i].reason) << " there";
      break;
    }
  }
  return found;
}

Found ExpectSameMotions(const SpaceSnapshot& here, const Client& client, const Policy& policy,
                        int count, Random& random) {
  Found found;
  for (int i = 0; i < count; ++i) {
    const Configuration from = AnyPlace(random);
    Configuration to = AnyPlace(random);
    if (i % 3 != 0) {
      for (size_t j = 0; j < 2; ++j) to[j] = from[j] + 0.1 * (to[j] - from[j]);
    }
    const auto there = client.CheckPath(std::vector{from, to}, policy);
    EXPECT_TRUE(there.ok()) << there.status();
    const MotionVerdict check = here.CheckMotion(from, to);
    found.Add(check.state);
    EXPECT_EQ(check.state, there->verdict.state);
    EXPECT_EQ(check.reason, there->verdict.reason);
    EXPECT_EQ(check.fraction, there->segment + there->fraction);
    if (!check.free()) {
      EXPECT_EQ(Configuration(check.place.begin(), check.place.begin() + 2), there->configuration);
    }
    EXPECT_EQ(check.checked, there->checked);
    EXPECT_EQ(check.proof, there->proof);
    EXPECT_EQ(check.sampled_step, there->sampled_step);
    if (::testing::Test::HasFailure()) break;
  }
  return found;
}

TEST(DrawnSpace, AnswersAsTheServerDoesAtAnyPlaceAndOnAnyMotion) {
  Random random;
  DrawnServer running;
  const Client client = running.client();
  for (const Policy& policy : {Policy{}, Policy{.preset = "paper"}, Policy{.min_views = 1},
                               Policy{.preset = "uncalibrated", .max_occluded_views = 2}}) {
    const LocalSpace space(client, WithPolicy(policy));
    Found checks;
    Found motions;
    for (int scene = 0; scene < 5; ++scene) {
      const auto snapshot = SnapshotOfScene(space, running.Publish(random, 1 + scene));
      const Found more = ExpectSameChecks(*snapshot, client, policy, 5000, random);
      checks.free += more.free;
      checks.occupied += more.occupied;
      checks.unknown += more.unknown;
      const Found moved = ExpectSameMotions(*snapshot, client, policy, 60, random);
      motions.free += moved.free;
      motions.occupied += moved.occupied;
      if (HasFailure()) return;
    }
    EXPECT_GT(checks.free, 500) << policy.preset;
    EXPECT_GT(checks.occupied, 200) << policy.preset;
    EXPECT_GT(checks.unknown, 100) << "beyond the limits";
    EXPECT_GT(motions.free, 10);
    EXPECT_GT(motions.occupied, 10);
  }
}

TEST(DrawnSpace, MissingViewIsNeverFree) {
  Random random;
  DrawnServer running;
  const Client client = running.client();
  const LocalSpace space(client, WithPolicy({}));
  for (int view = 0; view < 4; ++view) {
    const auto snapshot = SnapshotOfScene(space, running.Publish(random, 2, view));
    const Found checks = ExpectSameChecks(*snapshot, client, {}, 2000, random);
    EXPECT_EQ(checks.free, 0);
    EXPECT_GT(checks.occupied, 20);
    EXPECT_EQ(ExpectSameMotions(*snapshot, client, {}, 20, random).free, 0);
  }
}

TEST(DrawnSpace, AllowedRegionCountsAsInTheServer) {
  Random random;
  DrawnServer running;
  const Client client = running.client();
  const Policy policy{.min_views = 1};
  const LocalSpace space(client, WithPolicy(policy));
  const uint64_t scene = running.Publish(random, 3);
  const Found before =
      ExpectSameChecks(*SnapshotOfScene(space, scene), client, policy, 2000, random);
  v1::AllowRegionRequest request;
  request.set_name("part");
  for (const char* view : {"a", "b", "c", "d"}) {
    v1::RegionPixels& pixels = *request.add_views();
    pixels.set_view(view);
    Set(Mask::FromPredicate(kDrawnSize, [](int x, int) { return x < 40; }), pixels.mutable_mask());
  }
  request.mutable_duration()->set_seconds(60);
  running.server.Ask(&v1::SceneService::Stub::AllowRegion, request);
  auto snapshot = space.Snapshot();
  for (int i = 0; i < 100 && snapshot->basis().regions.empty(); ++i) {
    snapshot = space.WaitForUpdate(snapshot->number(), kDrawnSpaceLong / 20);
  }
  ASSERT_THAT(snapshot->basis().regions, ::testing::ElementsAre("part"));
  const Found after = ExpectSameChecks(*snapshot, client, policy, 2000, random);
  EXPECT_GT(after.free, before.free);
  EXPECT_THAT(snapshot->Check({0.1, 0.1}).regions, ::testing::ElementsAre("part"));
  ExpectSameMotions(*snapshot, client, policy, 30, random);
}

TEST(DrawnSpace, ForbiddenPlacesAreUnknownAndNoMotionCrossesThem) {
  Random random;
  DrawnServer running(DrawnSpaceDatabase(
      JointRegions({{{.joint = 0, .continuous = true, .lower = 0.3, .upper = 0.9},
                     {.joint = 1, .lower = -1, .upper = 1.5}}}),
      /*payload_radius=*/0.03));
  const Client client = running.client();
  const LocalSpace space(client, WithPolicy({}));
  const auto snapshot = SnapshotOfScene(space, running.Publish(random, 1));
  ExpectSameChecks(*snapshot, client, {}, 5000, random);
  const Found motions = ExpectSameMotions(*snapshot, client, {}, 150, random);
  EXPECT_GT(motions.unknown, 10);
  EXPECT_GT(motions.free, 10);
  EXPECT_EQ(snapshot->Check({0.5, 0}).reason, Reason::kExcluded);
  EXPECT_EQ(snapshot->CheckMotion(Configuration{0.1, 0}, Configuration{1.2, 0}).reason,
            Reason::kExcluded);
}

TEST(DrawnSpace, PresetsThatDoNotCountViewsAreRefusedWithASentence) {
  DrawnServer running;
  const LocalSpace space(running.client(), WithPolicy({.preset = "calibrated"}));
  const auto snapshot = space.WaitForUpdate(0, kDrawnSpaceLong);
  EXPECT_EQ(snapshot->unknown_reason(), Reason::kNotCheckedHere);
  EXPECT_THAT(std::string(space.status().problem.message()), HasSubstr("'calibrated'"));
  EXPECT_FALSE(space.Check({1, 0}).free());
  EXPECT_FALSE(space.CheckMotion(Configuration{1, 0}, Configuration{1.1, 0}).free());
}

TEST(DrawnSpace, WhatTheServerAnswersOfAnOlderSceneThanMaxAgeIsNotFree) {
  Random random;
  DrawnServer running;
  running.Publish(random, 0);
  const Policy policy{.preset = "calibrated"};  // which is not checked here
  const Configuration from{1, 0};
  const Configuration to{1.1, 0};
  const auto ask = [&](absl::Duration max_age) {
    const LocalSpace space(running.client(), {.policy = policy, .max_age = max_age});
    EXPECT_EQ(space.WaitForUpdate(0, kDrawnSpaceLong)->unknown_reason(), Reason::kNotCheckedHere);
    return space.CheckMotionOrAsk(from, to);
  };
  EXPECT_TRUE(ask(absl::Minutes(5)).free());
  EXPECT_EQ(ask(absl::Nanoseconds(1)).reason, Reason::kUpdateTooOld);
}

TEST(DrawnSpace, ExpiresWithTheScene) {
  Random random;
  DrawnServer running(DrawnSpaceDatabase(), absl::Seconds(1));
  const LocalSpace space(running.client(), {.max_age = absl::Minutes(1)});
  auto snapshot = space.WaitForUpdate(0, kDrawnSpaceLong);
  EXPECT_EQ(snapshot->unknown_reason(), Reason::kNoScene);
  EXPECT_EQ(snapshot->Check({1, 0}).reason, Reason::kNoScene);
  running.Publish(random, 0);
  snapshot = space.WaitForUpdate(snapshot->number(), kDrawnSpaceLong);
  const Configuration q{1, 0};
  while (client::RunningClock::now() < snapshot->usable_until()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(snapshot->Check(q).reason, Reason::kUpdateExpired);
  const MotionVerdict motion = snapshot->CheckMotion(q, q);
  EXPECT_EQ(motion.reason, Reason::kUpdateExpired);
  EXPECT_EQ(motion.proof, PathProof::kNone);
  EXPECT_FALSE(space.Check(q).free());
}

TEST(DrawnSpace, FollowsAnotherDatabase) {
  Random random;
  DrawnServer running;
  const Client client = running.client();
  const LocalSpace space(client, WithPolicy({}));
  ExpectSameChecks(*SnapshotOfScene(space, running.Publish(random, 3)), client, {}, 2000, random);
  // The robot is thicker now, and wider by the margin of the calibration.
  running.database = DrawnSpaceDatabase({}, /*payload_radius=*/0.3, /*margin=*/1.3);
  running.server.server->ReplaceDatabase(running.database);
  const uint64_t scene = running.Publish(random, 3);
  ExpectSameChecks(*SnapshotOfScene(space, scene), client, {}, 2000, random);
}

TEST(DrawnSpace, MotionThatCannotBeOrTakesTooLongIsNotFree) {
  Random random;
  DrawnServer running;
  const LocalSpace space(running.client(), WithPolicy({}));
  SceneInput input =
      DrawnSceneInput(*running.database->robot_images().drawn(), {2, 0}, {{{1, 0, 0.2}, 0.05}});
  const auto snapshot = SnapshotOfScene(space, running.server.Publish(input).id());
  const MotionVerdict far =
      snapshot->CheckMotion(Configuration{0, -1.9}, Configuration{9e5, -1.9}, 0.1);
  EXPECT_EQ(far.reason, Reason::kNotCheckedHere);
  EXPECT_EQ(far.proof, PathProof::kNone);
  EXPECT_EQ(far.place[1], -1.9);
  const Configuration q{1, 0};
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(snapshot->CheckMotion(q, Configuration{none, 0}).reason, Reason::kOutsideGrid);
  EXPECT_EQ(snapshot->CheckMotion(q, Configuration{1}).reason, Reason::kOutsideGrid);
  EXPECT_EQ(snapshot->CheckMotion(Configuration{}, q).reason, Reason::kOutsideGrid);
  EXPECT_EQ(snapshot->Check(Configuration{1, 0, 0}).reason, Reason::kOutsideGrid);
  for (const double resolution : {0.0, -1.0, 0.0001, 0.2, none}) {
    EXPECT_THROW(snapshot->CheckMotion(q, q, resolution), std::invalid_argument);
  }
}

// The first update of a stream that asks for obstacles.
DrawnUpdate FirstDrawnUpdate() {
  Random random;
  DrawnServer running(DrawnSpaceDatabase(JointRegions({{{.joint = 1, .lower = 1, .upper = 1.5}}})));
  running.Publish(random, 2);
  grpc::ClientContext context;
  v1::WatchConfigurationSpaceRequest request;
  request.set_obstacles(true);
  const auto reader = running.server.collision->WatchConfigurationSpace(&context, request);
  DrawnUpdate part;
  EXPECT_TRUE(reader->Read(&part));
  context.TryCancel();
  EXPECT_TRUE(part.last_part());
  return part;
}

TEST(DrawnSpace, MessageThatIsNotWholeIsRefused) {
  const DrawnUpdate good = FirstDrawnUpdate();
  EXPECT_EQ(good.tiles_size(), 0) << "no map is drawn for those who check by themselves";
  EXPECT_LT(good.planes(0).ByteSizeLong(), 600u);
  SpaceAssembly assembly;
  const auto update = assembly.Add(good);
  ASSERT_TRUE(update.ok() && *update) << update.status();
  ASSERT_NE((*update)->drawn, nullptr);

  const double none = std::numeric_limits<double>::quiet_NaN();
  using Break = std::function<void(DrawnUpdate&)>;
  const std::vector<Break> breaks = {
      [](DrawnUpdate& part) { part.clear_robot(); },
      [](DrawnUpdate& part) { part.clear_planes(); },
      [](DrawnUpdate& part) { part.mutable_planes()->RemoveLast(); },
      [](DrawnUpdate& part) { part.mutable_planes()->SwapElements(0, 1); },
      [](DrawnUpdate& part) { part.mutable_planes(0)->clear_mask(); },
      [](DrawnUpdate& part) { part.mutable_planes(0)->set_missing(true); },
      [](DrawnUpdate& part) { part.mutable_planes(0)->mutable_mask()->mutable_bits()->pop_back(); },
      [](DrawnUpdate& part) {
        v1::Mask& mask = *part.mutable_planes(0)->mutable_mask();
        mask.set_width(32);
        mask.set_bits(std::string(32 * 64 / 8, '\0'));
      },
      [](DrawnUpdate& part) { part.set_min_views(0); },
      [](DrawnUpdate& part) { part.set_min_views(5); },
      [](DrawnUpdate& part) { part.set_unknown_reason(v1::Verdict::REASON_SCENE_STALE); },
      [](DrawnUpdate& part) { part.mutable_robot()->clear_parts(); },
      [](DrawnUpdate& part) { part.mutable_robot()->clear_links(); },
      [](DrawnUpdate& part) { part.mutable_robot()->clear_views(); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_joints()->RemoveLast(); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_joints(0)->set_name("other"); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_joints(1)->set_upper(1); },
      [=](DrawnUpdate& part) { part.mutable_robot()->mutable_joints(1)->set_lower(none); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_links(1)->set_parent(1); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_links(1)->set_joint(2); },
      [=](DrawnUpdate& part) { part.mutable_robot()->mutable_links(1)->set_factor(none); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_links(1)->clear_axis(); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_links(1)->set_axis(2, 0); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_links(1)->clear_parent_from_link(); },
      [](DrawnUpdate& part) {
        part.mutable_robot()->mutable_links(1)->mutable_parent_from_link()->set_rotation(0, 0.5);
      },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_parts(0)->set_moves_with(77); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_parts(0)->set_radius(-1); },
      [=](DrawnUpdate& part) { part.mutable_robot()->mutable_parts(0)->set_points(1, none); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_parts(0)->clear_points(); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_parts(0)->add_points(1); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_views(0)->set_width(0); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_views(0)->set_height(5000); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_views(0)->set_fx(0); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_views(0)->set_margin(-1); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_views(0)->clear_distortion(); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_views(0)->clear_camera_from_world(); },
      [](DrawnUpdate& part) { part.mutable_robot()->mutable_forbidden(0)->clear_ranges(); },
      [](DrawnUpdate& part) {
        part.mutable_robot()->mutable_forbidden(0)->mutable_ranges(0)->set_joint(2);
      },
      [=](DrawnUpdate& part) {
        part.mutable_robot()->mutable_forbidden(0)->mutable_ranges(0)->set_lower(none);
      },
  };
  for (size_t i = 0; i < breaks.size(); ++i) {
    DrawnUpdate part = good;
    breaks[i](part);
    SpaceAssembly broken;
    const auto refused = broken.Add(part);
    EXPECT_EQ(refused.status().code(), absl::StatusCode::kInternal) << "break " << i;
    EXPECT_NE(refused.status().message(), "");
  }
}

TEST(DrawnSpace, WhatIsNearestToAFreeNodeIsFreeAtOnceAndNothingElse) {
  DrawnUpdate part = FirstDrawnUpdate();
  for (v1::ObstaclePlane& plane : *part.mutable_planes()) {
    plane.mutable_mask()->set_bits(std::string(kDrawnSize.bytes(), '\xff'));
  }
  const auto state = [](const DrawnUpdate& of, const Configuration& q) {
    SpaceAssembly assembly;
    const auto update = assembly.Add(of);
    EXPECT_TRUE(update.ok() && *update) << update.status();
    return (*update)->drawn->Check(q, *(*update)->map);
  };
  EXPECT_EQ(state(part, {-3, 0}).state, State::kOccupied);
  // The free node is at the first value of "turn".
  v1::ConfigurationSpaceTile& tile = *part.add_tiles();
  tile.set_free(std::string(1, '\x01') + std::string(kTileSize / 8 - 1, '\0'));
  tile.set_occupied(std::string(kTileSize / 8, '\0'));
  EXPECT_EQ(state(part, {-3, -1.9}).state, State::kOccupied) << "no node";
  part.mutable_grid()->mutable_joints(1)->set_steps(1);
  for (const double lift : {-2.0, 0.0, 0.9}) {
    EXPECT_TRUE(state(part, {-3, lift}).free());
    EXPECT_TRUE(state(part, {-4, lift}).free());
    EXPECT_EQ(state(part, {0, lift}).state, State::kOccupied);
  }
  EXPECT_EQ(state(part, {-3, 1.2}).reason, Reason::kExcluded);
  EXPECT_EQ(state(part, {-3, 2.1}).reason, Reason::kOutsideGrid);
}

TEST(DrawnSpace, PlanesCountForOneUpdateAndTheRobotForTheStream) {
  DrawnUpdate first = FirstDrawnUpdate();
  SpaceAssembly assembly;
  ASSERT_TRUE(assembly.Add(first).ok());
  DrawnUpdate next = first;
  next.set_whole(false);
  next.clear_grid();
  SpaceAssembly repeated = assembly;
  EXPECT_FALSE(repeated.Add(next).ok()) << "the robot comes with an update that is whole";
  next.clear_robot();
  SpaceAssembly other = assembly;
  auto update = other.Add(next);
  ASSERT_TRUE(update.ok() && *update) << update.status();
  EXPECT_NE((*update)->drawn, nullptr);
  next.clear_planes();
  EXPECT_FALSE(other.Add(next).ok()) << "never with older planes";
  next.set_unknown_reason(v1::Verdict::REASON_SCENE_STALE);
  update = assembly.Add(next);
  ASSERT_TRUE(update.ok() && *update) << update.status();
  EXPECT_EQ((*update)->drawn, nullptr);
  first.clear_robot();
  first.clear_planes();
  update = assembly.Add(first);
  ASSERT_TRUE(update.ok() && *update) << update.status();
  EXPECT_EQ((*update)->drawn, nullptr) << "of another database";
}

}  // namespace
}  // namespace silhouette::client
