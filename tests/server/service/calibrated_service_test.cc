// SPDX-License-Identifier: Apache-2.0
// The calibrated test as planners meet it: what it finds and lets go that the uncalibrated test
// does not, and when it must not answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

ServingSettings ChoosingPreset() {
  ServingSettings settings;
  settings.choose_preset = true;
  return settings;
}

// The robot stands at (2, 7): a post of rows 5 to 10 (of "left" and "right"; two rows less in
// "top"). Something in front of it hides part of it only in "left": there alone it is seen beside
// the post, and the two others have nothing but unknown pixels in its rows.
SceneInput HiddenByTheRobot() {
  SceneInput input = EmptyCellScene(2, 7);
  const Mask beside = Mask::FromPredicate(
      kViewSizes[0], [](int x, int y) { return (x == 6 || x == 7) && (y == 9 || y == 10); });
  input.views[0].image = SceneMask{RobotMask(0, 2, 7) | beside};
  return input;
}

struct CalibratedService : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = NewDatabase({.calibration = TestCalibration()});
  TestServer server{database, ChoosingPreset()};

  v1::Verdict::State StateAt(const Configuration& q, const v1::Policy& policy = {}) {
    return server.CheckOne(q, policy).state();
  }

  // What every way to ask says of a grid point, which must be one and the same.
  v1::Verdict::State StateEverywhere(int a, int b, const v1::Policy& policy) {
    const v1::Verdict::State state = StateAt(At(a, b), policy);
    v1::CheckPathRequest path;
    Set(At(a, b), path.add_waypoints());
    *path.mutable_policy() = policy;
    v1::CheckPathResponse on_path;
    EXPECT_TRUE(server.Call(path, &on_path).ok());
    EXPECT_EQ(on_path.verdict().state(), state);
    v1::GetConfigurationSpaceRequest space;
    *space.mutable_policy() = policy;
    const auto messages = server.Space(space);
    const ConfigurationNumber number = database->grid().NumberOf({a, b});
    for (const v1::ConfigurationSpaceTile& tile : messages.at(0).tiles()) {
      if (tile.tile() != number / kTileSize) continue;
      const size_t place = number % kTileSize;
      const auto bit = [&](const std::string& bytes) {
        return (static_cast<uint8_t>(bytes[place / 8]) >> (place % 8) & 1) != 0;
      };
      EXPECT_EQ(bit(tile.free()), state == v1::Verdict::STATE_FREE);
      EXPECT_EQ(bit(tile.occupied()), state == v1::Verdict::STATE_OCCUPIED);
    }
    return state;
  }
};

TEST_F(CalibratedService, FindsWhatTheRobotHidesInAllViewsButOne) {
  server.Publish(HiddenByTheRobot());
  // The test robot image takes in what is seen beside the post, and the post's own rows elsewhere.
  const Configuration between = {2.5, At(2, 7)[1]};
  EXPECT_EQ(StateAt(between, PolicyNamed("uncalibrated")), v1::Verdict::STATE_FREE);
  EXPECT_EQ(StateAt(between, PolicyNamed("paper")), v1::Verdict::STATE_FREE);
  EXPECT_EQ(StateAt(between, PolicyNamed("calibrated")), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(StateAt(between, PolicyNamed("paper-calibrated")), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(StateAt(between), v1::Verdict::STATE_FREE) << "uncalibrated by default";
}

TEST_F(CalibratedService, LetsGoWhatOneViewSeesToBeEmpty) {
  server.Publish(SceneWithBlock(3, 2));
  EXPECT_EQ(StateEverywhere(3, 3, PolicyNamed("uncalibrated")), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(StateEverywhere(3, 3, PolicyNamed("calibrated")), v1::Verdict::STATE_FREE);
  EXPECT_EQ(StateEverywhere(3, 3, PolicyNamed("paper-calibrated")), v1::Verdict::STATE_FREE);
  // Fewer views are enough if the request says so.
  v1::Policy two = PolicyNamed("calibrated");
  two.set_min_views(2);
  EXPECT_EQ(StateEverywhere(3, 3, two), v1::Verdict::STATE_OCCUPIED);
  // The margin lets the foot's row, unknown in "top", meet the block's.
  TestServer wide(NewDatabase({.calibration = TestCalibration()}, {.margin = 0.25}));
  wide.Publish(SceneWithBlock(3, 2));
  EXPECT_EQ(wide.CheckOne(At(3, 3), PolicyNamed("calibrated")).state(),
            v1::Verdict::STATE_OCCUPIED);
}

TEST_F(CalibratedService, SearchesLinesWhereThePresetSays) {
  // What "left" shows beside the post is outside the test robot image of grid point (2, 3), whose
  // post is in the rows of it: the obstacle images have it on the lines, the intersections do not.
  server.Publish(HiddenByTheRobot());
  EXPECT_EQ(StateEverywhere(2, 3, PolicyNamed("calibrated")), v1::Verdict::STATE_FREE);
  v1::Policy policy = PolicyNamed("paper-calibrated");
  policy.set_min_views(2);
  EXPECT_EQ(StateEverywhere(2, 3, policy), v1::Verdict::STATE_OCCUPIED);
}

TEST_F(CalibratedService, ErrorsConvictWhereThePresetSays) {
  // The robot's post is not seen in "left": errors there, unknown in the same rows of the others.
  ServingSettings settings = ChoosingPreset();
  settings.scene.max_core_error = 1;
  TestServer lenient(database, settings);
  SceneInput input = EmptyCellScene(2, 7);
  input.views[0].image = SceneMask{RobotMask(0, 4, 0) & RobotMask(0, 2, 0)};  // the foot alone
  lenient.Publish(input);
  v1::Policy policy = PolicyNamed("calibrated");
  EXPECT_EQ(lenient.CheckOne(At(2, 3), policy).state(), v1::Verdict::STATE_FREE);
  policy.set_min_views(2);
  EXPECT_EQ(lenient.CheckOne(At(2, 3), policy).state(), v1::Verdict::STATE_FREE);
  policy.set_preset("paper-calibrated");
  EXPECT_EQ(lenient.CheckOne(At(2, 3), policy).state(), v1::Verdict::STATE_OCCUPIED);
}

TEST_F(CalibratedService, ExplainsTheCollisionImageOfThePolicy) {
  server.Publish(HiddenByTheRobot());
  const auto collision_png = [&](const std::string& preset, int view) {
    v1::ExplainRequest request;
    Set({2.5, At(2, 7)[1]}, request.mutable_configuration());
    *request.mutable_policy() = PolicyNamed(preset);
    v1::ExplainResponse response;
    EXPECT_TRUE(server.Call(request, &response).ok());
    return response.views(view).collision_png();
  };
  const std::string nothing = collision_png("uncalibrated", 1);
  EXPECT_FALSE(nothing.empty());
  EXPECT_NE(collision_png("calibrated", 1), nothing);
  EXPECT_NE(collision_png("paper-calibrated", 1), nothing);
  EXPECT_EQ(collision_png("paper", 1), nothing);
}

TEST_F(CalibratedService, TellsThatItIsCalibratedAndWhatItCanServe) {
  const v1::GetDatabaseResponse response = server.GetDatabase();
  EXPECT_TRUE(response.calibrated());
  EXPECT_THAT(response.presets(),
              ElementsAre("uncalibrated", "paper", "calibrated", "paper-calibrated"));
  EXPECT_EQ(response.default_policy().preset(), "uncalibrated");
}

TEST_F(CalibratedService, RefusesOptionsThatDoNotGoWithThePreset) {
  const auto refusal = [&](const v1::Policy& policy) {
    v1::CheckConfigurationsRequest request;
    Set(At(0, 0), request.add_configurations());
    *request.mutable_policy() = policy;
    v1::CheckConfigurationsResponse response;
    const grpc::Status status = server.Call(request, &response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    return status.error_message();
  };
  v1::Policy policy = PolicyNamed("calibrated");
  policy.set_max_occluded_views(1);
  EXPECT_THAT(refusal(policy), HasSubstr("policy.max_occluded_views: it goes with"));
  EXPECT_THAT(refusal(PolicyNamed("best")), HasSubstr("known are 'uncalibrated', 'paper', 'cal"));
}

TEST_F(CalibratedService, WithAMissingViewIsNeverFree) {
  SceneInput input = EmptyCellScene();
  input.views.pop_back();
  server.Publish(input);
  for (const char* preset : {"calibrated", "paper-calibrated"}) {
    for (const int min_views : {1, 2, 3}) {
      v1::Policy policy = PolicyNamed(preset);
      policy.set_min_views(min_views);
      for (int a = 0; a < 5; ++a) {
        for (int b = 0; b < 8; ++b) {
          EXPECT_NE(StateEverywhere(a, b, policy), v1::Verdict::STATE_FREE) << preset;
        }
      }
      EXPECT_NE(StateAt({0.5, 0.1}, policy), v1::Verdict::STATE_FREE);
    }
  }
}

TEST_F(CalibratedService, AfterAnotherCalibrationOldScenesAreOfNoUse) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.calibration = TestCalibration()});
  TestServer changing(LoadDatabase(folder / "db"), ChoosingPreset());
  changing.Publish(EmptyCellScene());
  EXPECT_EQ(changing.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  {
    const auto stored = Database::Open(folder / "db", Database::Access::kWrite);
    ASSERT_TRUE((*stored)->RemoveCalibration("test").ok());
  }
  changing.server->ReplaceDatabase(LoadDatabase(folder / "db"));
  EXPECT_EQ(changing.CheckOne(At(1, 0)).reason(), v1::Verdict::REASON_GENERATION_MISMATCH);
  changing.Publish(EmptyCellScene());
  EXPECT_EQ(changing.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  const v1::GetDatabaseResponse response = changing.GetDatabase();
  EXPECT_FALSE(response.calibrated());
  EXPECT_EQ(response.default_policy().preset(), "uncalibrated");
}

TEST(ServiceWithoutCalibration, RefusesPresetsThatNeedOneInEveryCall) {
  TestServer server(NewDatabase());
  for (const bool with_scene : {false, true}) {
    if (with_scene) server.Publish(EmptyCellScene());
    for (const char* preset : {"calibrated", "paper-calibrated"}) {
      const auto expect_refusal = [&](const grpc::Status& status) {
        EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
        EXPECT_THAT(status.error_message(), HasSubstr("needs a calibration"));
        EXPECT_THAT(status.error_message(), HasSubstr(preset));
      };
      v1::CheckConfigurationsRequest check;
      Set(At(0, 0), check.add_configurations());
      *check.mutable_policy() = PolicyNamed(preset);
      v1::CheckConfigurationsResponse checked;
      expect_refusal(server.Call(check, &checked));
      EXPECT_EQ(checked.verdicts_size(), 0);
      v1::CheckPathRequest path;
      Set(At(0, 0), path.add_waypoints());
      *path.mutable_policy() = PolicyNamed(preset);
      v1::CheckPathResponse on_path;
      expect_refusal(server.Call(path, &on_path));
      v1::ExplainRequest explain;
      Set(At(0, 0), explain.mutable_configuration());
      *explain.mutable_policy() = PolicyNamed(preset);
      v1::ExplainResponse explanation;
      expect_refusal(server.Call(explain, &explanation));
      v1::GetConfigurationSpaceRequest space;
      *space.mutable_policy() = PolicyNamed(preset);
      std::vector<v1::GetConfigurationSpaceResponse> messages;
      expect_refusal(server.Call(space, &messages));
      EXPECT_TRUE(messages.empty());
    }
  }
}

}  // namespace
}  // namespace silhouette
