// SPDX-License-Identifier: Apache-2.0
// Every case that must never yield free, asked over the API; where it makes all unknown, in every
// way that there is: single checks, a path, the configuration space, an explanation, and the three
// streams.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <stdexcept>

#include "tests/server/service/test_server.h"
#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

struct NeverFree : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = NewDatabase(
      {.missing = {{0, 7}}, .excluded = {{4, 7}}, .corrupt = {{2, 7}}, .references = true});
  TestServer server{database, Settings()};

  static ServingSettings Settings() {
    ServingSettings settings;
    settings.scene.max_core_error = 0.001;
    return settings;
  }

  static bool TellsClearance(const v1::Verdict& verdict) {
    return verdict.has_clearance() ||
           std::any_of(verdict.views().begin(), verdict.views().end(),
                       [](const v1::ViewEvidence& view) { return view.has_distance(); });
  }

  void ExpectOnlyUnknown(v1::Verdict::Reason reason) {
    std::vector<Configuration> all = {{0.5, 0.1}, {3.9, 7.0}};
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) all.push_back(At(a, b));
    }
    for (const bool clearance : {false, true}) {
      const v1::CheckConfigurationsResponse checked = server.Check(all, {}, clearance);
      for (const v1::Verdict& verdict : checked.verdicts()) {
        EXPECT_EQ(verdict.state(), v1::Verdict::STATE_UNKNOWN);
        EXPECT_EQ(verdict.reason(), reason) << v1::Verdict::Reason_Name(verdict.reason());
        EXPECT_FALSE(TellsClearance(verdict));
      }
      const v1::CheckPathResponse path = server.Path({At(0, 0), At(1, 0)}, clearance);
      EXPECT_EQ(path.verdict().state(), v1::Verdict::STATE_UNKNOWN);
      EXPECT_EQ(path.verdict().reason(), reason);
      EXPECT_FALSE(TellsClearance(path.verdict()));
      EXPECT_FALSE(path.has_narrowest());
    }
    const v1::CheckConfigurationsResponse numbers = server.CheckNumbers({0, 1, 2, 5000});
    EXPECT_EQ(numbers.unknown_reason(), reason);
    EXPECT_EQ(numbers.free(), std::string(1, '\0'));
    EXPECT_EQ(numbers.occupied(), std::string(1, '\0'));
    const v1::ExplainResponse explanation = server.Explain(At(1, 0));
    EXPECT_EQ(explanation.verdict().state(), v1::Verdict::STATE_UNKNOWN);
    EXPECT_EQ(explanation.verdict().reason(), reason);
    const auto space = server.Space();
    ASSERT_EQ(space.size(), 1u);
    EXPECT_EQ(space[0].unknown_reason(), reason);
    EXPECT_EQ(space[0].tiles_size(), 0);
    EXPECT_EQ(space[0].grid().joints_size(), 2);
    ExpectOnlyUnknownInStreams(reason);
  }

  void ExpectOnlyUnknownInStreams(v1::Verdict::Reason reason) {
    Asking asking(server);
    asking.Send(1, At(1, 0));
    const v1::StreamChecksResponse asked = asking.Next();
    ASSERT_EQ(asked.configurations().verdicts_size(), 1);
    EXPECT_EQ(asked.configurations().verdicts(0).state(), v1::Verdict::STATE_UNKNOWN);
    EXPECT_EQ(asked.configurations().verdicts(0).reason(), reason);
    const v1::Verdict watched = PathWatching(server, {At(0, 0), At(1, 0)}).Next().check().verdict();
    EXPECT_EQ(watched.state(), v1::Verdict::STATE_UNKNOWN);
    EXPECT_EQ(watched.reason(), reason);
    const SpaceUpdate space = SpaceWatching(server).Next();
    EXPECT_EQ(space.first.unknown_reason(), reason);
    EXPECT_EQ(space.tiles, 0u);
  }

  void ExpectDefect(const v1::Scene& scene, v1::Verdict::Reason reason) {
    ASSERT_EQ(scene.defects_size(), 1);
    EXPECT_EQ(scene.defects(0).reason(), reason);
    EXPECT_FALSE(scene.defects(0).message().empty());
    ExpectOnlyUnknown(reason);
  }
};

TEST_F(NeverFree, TheSameCellWithAGoodSceneIsFree) {
  EXPECT_EQ(server.Publish(EmptyCellScene()).defects_size(), 0);
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  EXPECT_EQ(server.Path({At(0, 0), At(1, 0)}).verdict().state(), v1::Verdict::STATE_FREE);
  EXPECT_EQ(server.Explain(At(1, 0)).verdict().state(), v1::Verdict::STATE_FREE);
}

TEST_F(NeverFree, NoSceneYet) { ExpectOnlyUnknown(v1::Verdict::REASON_NO_SCENE); }

TEST_F(NeverFree, SceneOlderThanMaxAge) {
  server.Publish(EmptyCellScene());
  server.clock.Advance(absl::Milliseconds(1001));
  ExpectOnlyUnknown(v1::Verdict::REASON_SCENE_STALE);
}

TEST_F(NeverFree, SceneThatWasStaleOnArrival) {
  SceneInput input = EmptyCellScene();
  for (ViewInput& view : input.views)
    view.captured = MomentOf(server.clock.now() - absl::Seconds(2), server.clock.clock()());
  ExpectDefect(server.Publish(input), v1::Verdict::REASON_SCENE_STALE);
}

TEST_F(NeverFree, ViewsFurtherApartThanMaxSkew) {
  SceneInput input = EmptyCellScene();
  input.views[2].captured =
      MomentOf(server.clock.now() - absl::Milliseconds(80), server.clock.clock()());
  ExpectDefect(server.Publish(input), v1::Verdict::REASON_SCENE_SKEWED);
}

TEST_F(NeverFree, ViewMissingFromTheScene) {
  for (int lost = 0; lost < 3; ++lost) {
    SceneInput input = EmptyCellScene();
    input.views.erase(input.views.begin() + lost);
    const v1::Scene scene = server.Publish(input);
    ASSERT_EQ(scene.defects_size(), 1);
    EXPECT_EQ(scene.defects(0).reason(), v1::Verdict::REASON_VIEW_MISSING);
    for (int occluded = 0; occluded < 3; ++occluded) {
      v1::Policy policy;
      policy.set_max_occluded_views(occluded);
      // min_views is 3, 2, 1; the missing view alone reaches 1.
      const v1::Verdict verdict = server.CheckOne(At(1, 0), policy);
      if (occluded < 2) {
        EXPECT_EQ(verdict.state(), v1::Verdict::STATE_UNKNOWN);
        EXPECT_EQ(verdict.reason(), v1::Verdict::REASON_VIEW_MISSING);
      } else {
        EXPECT_EQ(verdict.state(), v1::Verdict::STATE_OCCUPIED);
      }
      EXPECT_TRUE(verdict.views(lost).missing());
    }
    EXPECT_NE(server.Path({At(0, 0), At(1, 0)}).verdict().state(), v1::Verdict::STATE_FREE);
    for (const auto& message : server.Space()) {
      for (const auto& tile : message.tiles()) {
        EXPECT_EQ(tile.free().find_first_not_of('\0'), std::string::npos);
      }
    }
  }
}

TEST_F(NeverFree, CameraThatStopped) {
  // All views came once; then one camera delivers nothing any more, and at last none does.
  server.Publish(EmptyCellScene());
  server.clock.Advance(absl::Milliseconds(40));
  SceneInput input = EmptyCellScene();
  input.views.pop_back();
  server.Publish(input);
  EXPECT_EQ(server.CheckOne(At(1, 0)).reason(), v1::Verdict::REASON_VIEW_MISSING);
  server.clock.Advance(absl::Seconds(2));
  ExpectOnlyUnknown(v1::Verdict::REASON_SCENE_STALE);
}

struct FrozenCamera : NeverFree {
  // What the camera of view 0 gives: its picture with a `grain` of the noise in one corner.
  SceneInput Pictured(int grain) {
    SceneInput input = EmptyCellScene();
    cv::Mat picture = CameraPicture(0, RobotMask(0, 0, 0));
    picture.data[0] = static_cast<uchar>(picture.data[0] + grain);
    input.views[0].image = EncodedImage{PngOf(picture)};
    return input;
  }
  // Taken so long after the one before.
  v1::Scene Publish(TestServer& to, int grain, absl::Duration later = absl::Milliseconds(50)) {
    to.clock.Advance(later);
    return to.Publish(Pictured(grain));
  }
};

TEST_F(FrozenCamera, ThatRepeatsItsImageUnderNewTimesIsMissingUntilItGivesAnother) {
  for (int image = 0; image < 2; ++image) {
    EXPECT_EQ(Publish(server, 0).defects_size(), 0);
    EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  }
  for (int image = 0; image < 3; ++image) {
    const v1::Scene scene = Publish(server, 0);
    ASSERT_EQ(scene.defects_size(), 1);
    EXPECT_EQ(scene.defects(0).reason(), v1::Verdict::REASON_VIEW_MISSING);
    EXPECT_THAT(scene.defects(0).message(), testing::HasSubstr("the camera is frozen"));
    EXPECT_EQ(server.CheckOne(At(1, 0)).reason(), v1::Verdict::REASON_VIEW_MISSING);
    EXPECT_EQ(server.Path({At(0, 0), At(1, 0)}).verdict().state(), v1::Verdict::STATE_UNKNOWN);
  }
  EXPECT_EQ(Publish(server, 1).defects_size(), 0);
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
}

TEST_F(FrozenCamera, ThatRepeatsARingOfImagesIsMissingUntilItGivesAnother) {
  constexpr int kRing = 4;
  for (int image = 0; image <= kRing; ++image) {
    EXPECT_EQ(Publish(server, image % kRing).defects_size(), 0);
  }
  for (int image = kRing + 1; image < 3 * kRing; ++image) {
    ASSERT_EQ(Publish(server, image % kRing).defects_size(), 1);
    EXPECT_EQ(server.CheckOne(At(1, 0)).reason(), v1::Verdict::REASON_VIEW_MISSING);
  }
  EXPECT_EQ(Publish(server, kRing).defects_size(), 0);
}

TEST_F(FrozenCamera, HasNoMaskInItsPlace) {
  for (int image = 0; image < 3; ++image) Publish(server, 0);
  SceneInput input = Pictured(0);
  input.views.push_back({kViewNames[0], {}, ObstacleMask{Mask(RobotMask(0, 0, 0).size())}});
  server.clock.Advance(absl::Milliseconds(50));
  const grpc::Status status = server.PublishStatus(server.Stamped(RequestOf(input)));
  EXPECT_THAT(status.error_message(), testing::HasSubstr("the view is given twice"));
}

// Behind a frozen camera's image the fields are still those of the request.
TEST_F(FrozenCamera, ChangesNoNumberOfAFieldInARefusal) {
  for (int image = 0; image < 3; ++image) Publish(server, 0);
  SceneInput input = Pictured(0);
  input.views[2].image = SceneMask{Mask({3, 3})};
  server.clock.Advance(absl::Milliseconds(50));
  const grpc::Status status = server.PublishStatus(server.Stamped(RequestOf(input)));
  EXPECT_THAT(status.error_message(), testing::StartsWith("views[2] 'top': "));
}

// Its time would let no later image count as taken after it.
TEST_F(FrozenCamera, IsNoticedAfterAnImageOfTheFutureWasRefused) {
  v1::PublishSceneRequest future = RequestOf(Pictured(0));
  for (v1::ViewImage& view : *future.mutable_views()) {
    Set(server.clock.now() + absl::Hours(1), view.mutable_capture_time());
  }
  EXPECT_EQ(server.PublishStatus(future).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  for (int image = 0; image < 4; ++image) Publish(server, 1);
  EXPECT_EQ(server.CheckOne(At(1, 0)).reason(), v1::Verdict::REASON_VIEW_MISSING);
}

TEST_F(FrozenCamera, IsNoneWhoseImagesAreSentAgainAtOnce) {
  for (int image = 0; image < 6; ++image) {
    EXPECT_EQ(Publish(server, image).defects_size(), 0);
    for (int again = 0; again < 3; ++again) {
      EXPECT_EQ(Publish(server, image, absl::ZeroDuration()).defects_size(), 0);
    }
  }
}

TEST_F(FrozenCamera, IsNoneWhoseSourceHasNoNoise) {
  ServingSettings settings = Settings();
  settings.without_noise = {kViewNames[0]};
  TestServer quiet(database, settings);
  for (int image = 0; image < 6; ++image) EXPECT_EQ(Publish(quiet, 0).defects_size(), 0);
}

TEST_F(NeverFree, CameraThatGivesAnImageOfThePast) {
  SceneInput input = EmptyCellScene();
  input.views[1].captured = MomentOf(server.clock.now(), server.clock.clock()());
  server.clock.Advance(absl::Milliseconds(400));
  ExpectDefect(server.Publish(input), v1::Verdict::REASON_SCENE_SKEWED);
}

TEST_F(NeverFree, RobotPositionUnknown) {
  SceneInput input = EmptyCellScene();
  input.joints = {{"lift", 0.5}};
  ExpectDefect(server.Publish(input), v1::Verdict::REASON_ROBOT_POSITION_UNKNOWN);
}

TEST_F(NeverFree, RobotOutsideTheGrid) {
  SceneInput input = EmptyCellScene();
  input.joints[0].position = 4.5;
  ExpectDefect(server.Publish(input), v1::Verdict::REASON_ROBOT_POSITION_UNKNOWN);
}

TEST_F(NeverFree, JointOutsideTheGridNotWhereItWasCaptured) {
  SceneInput input = EmptyCellScene();
  input.joints[2].position = 0.49;
  ExpectDefect(server.Publish(input), v1::Verdict::REASON_FIXED_JOINT_MOVED);
  input.joints.pop_back();
  ExpectDefect(server.Publish(input), v1::Verdict::REASON_FIXED_JOINT_MOVED);
}

TEST_F(NeverFree, RobotImageOfThePresentConfigurationMissingExcludedOrCorrupt) {
  for (int a : {0, 2, 4}) {
    ExpectDefect(server.Publish(EmptyCellScene(a, 7)),
                 v1::Verdict::REASON_ROBOT_IMAGE_OF_SCENE_MISSING);
  }
}

TEST_F(NeverFree, TooLargeAnAreaOfCoreErrors) {
  // The robot says that it is at (0, 0); no view sees it.
  SceneInput input = EmptyCellScene();
  input.views[1].image = SceneMask{Mask(kViewSizes[1])};
  ExpectDefect(server.Publish(input), v1::Verdict::REASON_ERROR_AREA);
}

TEST_F(NeverFree, SceneOfAnotherGenerationOfTheDatabase) {
  server.Publish(EmptyCellScene());
  server.server->ReplaceDatabase(NewDatabase());
  ExpectOnlyUnknown(v1::Verdict::REASON_GENERATION_MISMATCH);
  server.Publish(EmptyCellScene());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
}

TEST_F(NeverFree, ConfigurationOutsideTheGridMissingExcludedOrCorrupt) {
  server.Publish(EmptyCellScene());
  const std::vector<std::pair<Configuration, v1::Verdict::Reason>> cases = {
      {{-0.1, 0}, v1::Verdict::REASON_OUTSIDE_GRID},
      {{4.1, 0}, v1::Verdict::REASON_OUTSIDE_GRID},
      {{std::nan(""), 0}, v1::Verdict::REASON_OUTSIDE_GRID},
      {{0, INFINITY}, v1::Verdict::REASON_OUTSIDE_GRID},
      {At(0, 7), v1::Verdict::REASON_ROBOT_IMAGE_MISSING},
      {At(4, 7), v1::Verdict::REASON_EXCLUDED},
      {At(2, 7), v1::Verdict::REASON_ROBOT_IMAGE_CORRUPT},
      {{1.5, At(2, 7)[1]}, v1::Verdict::REASON_ROBOT_IMAGE_CORRUPT}};
  for (const auto& [q, reason] : cases) {
    for (const v1::Verdict& verdict :
         {server.CheckOne(q), server.Path({At(1, 0), q}).verdict(), server.Explain(q).verdict()}) {
      EXPECT_EQ(verdict.state(), v1::Verdict::STATE_UNKNOWN);
    }
    EXPECT_EQ(server.CheckOne(q).reason(), reason);
  }
}

TEST_F(NeverFree, PathThatPassesAnUnusableConfiguration) {
  server.Publish(EmptyCellScene());
  const v1::CheckPathResponse path = server.Path({At(1, 7), At(3, 7)});
  EXPECT_EQ(path.verdict().reason(), v1::Verdict::REASON_ROBOT_IMAGE_CORRUPT);
  EXPECT_LT(path.fraction(), 0.5);
}

TEST(NeverFreeLate, SceneThatBecomesTooOldWhileTheAnswerIsMade) {
  // Every look at the clock takes 0.6 s; max_age is 1 s.
  std::atomic<bool> slow = false;
  TestClock passing;
  TestServer server(NewDatabase(), {}, [&](Clock) -> Clock {
    return [&] {
      if (slow) passing.Advance(absl::Milliseconds(600));
      return passing.clock()();
    };
  });
  const auto fresh = [&] {
    slow = false;
    server.Publish(EmptyCellScene());
    EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
    slow = true;
  };
  fresh();
  const v1::CheckConfigurationsResponse checked = server.Check({At(1, 0)}, {}, true);
  EXPECT_EQ(checked.verdicts(0).reason(), v1::Verdict::REASON_SCENE_STALE);
  EXPECT_FALSE(checked.verdicts(0).has_clearance());
  EXPECT_FALSE(checked.verdicts(0).views(0).has_distance());
  EXPECT_GE(checked.basis().scene_age().seconds(), 1);
  fresh();
  const v1::CheckPathResponse path = server.Path({At(1, 0), At(0, 0)}, true);
  EXPECT_EQ(path.verdict().reason(), v1::Verdict::REASON_SCENE_STALE);
  EXPECT_FALSE(path.verdict().has_clearance());
  EXPECT_FALSE(path.has_narrowest());
  fresh();
  const v1::CheckConfigurationsResponse numbers = server.CheckNumbers({0, 1});
  EXPECT_EQ(numbers.unknown_reason(), v1::Verdict::REASON_SCENE_STALE);
  EXPECT_EQ(numbers.free(), std::string(1, '\0'));
  fresh();
  EXPECT_EQ(server.Explain(At(1, 0)).verdict().reason(), v1::Verdict::REASON_SCENE_STALE);
}

// An exception while one request is answered.
TEST(NeverFreeInternal, AnyInternalError) {
  std::atomic<bool> broken = false;
  TestServer server(NewDatabase(), {}, [&broken](Clock inner) -> Clock {
    return [&broken, inner] {
      if (broken) throw std::runtime_error("broken clock");
      return inner();
    };
  });
  server.Publish(EmptyCellScene());
  ASSERT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  broken = true;
  v1::CheckConfigurationsRequest check;
  Set(At(1, 0), check.add_configurations());
  v1::CheckConfigurationsResponse checked;
  EXPECT_EQ(server.Call(check, &checked).error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_EQ(checked.verdicts_size(), 0);
  v1::CheckPathRequest path;
  Set(At(1, 0), path.add_waypoints());
  v1::CheckPathResponse path_checked;
  EXPECT_EQ(server.Call(path, &path_checked).error_code(), grpc::StatusCode::INTERNAL);
  std::vector<v1::GetConfigurationSpaceResponse> space;
  EXPECT_EQ(server.Call(v1::GetConfigurationSpaceRequest(), &space).error_code(),
            grpc::StatusCode::INTERNAL);
  EXPECT_TRUE(space.empty());
  broken = false;
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE) << "it serves on";
}

}  // namespace
}  // namespace silhouette
