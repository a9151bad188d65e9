// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/service/calls.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

struct SceneServiceTest : ::testing::Test {
  TestServer server{NewDatabase({.references = true})};
  v1::PublishSceneRequest request = server.Stamped(RequestOf(EmptyCellScene()));

  std::string Refusal(grpc::StatusCode code = grpc::StatusCode::INVALID_ARGUMENT) {
    const grpc::Status status = server.PublishStatus(request);
    EXPECT_EQ(status.error_code(), code) << status.error_message();
    return status.error_message();
  }
  grpc::Status Get(uint64_t id, bool planes, v1::Scene* scene) {
    v1::GetSceneRequest get;
    get.set_id(id);
    get.set_include_planes(planes);
    v1::GetSceneResponse response;
    const grpc::Status status = server.Call(&v1::SceneService::Stub::GetScene, get, &response);
    *scene = response.scene();
    return status;
  }
  static Mask MaskOf(const v1::Mask& message) {
    const std::string& bits = message.bits();
    return Mask::FromBytes({message.width(), message.height()},
                           {reinterpret_cast<const uint8_t*>(bits.data()), bits.size()});
  }
};

TEST_F(SceneServiceTest, PublishTellsWhatWasSeen) {
  const v1::Scene scene = server.Publish(SceneWithBlock(3, 1));
  EXPECT_EQ(scene.id(), 1u);
  EXPECT_GT(scene.database_generation(), 0u);
  EXPECT_EQ(scene.defects_size(), 0);
  EXPECT_EQ(scene.time().seconds(), 1'000'000);
  EXPECT_EQ(scene.joints_size(), 3);
  ASSERT_EQ(scene.views_size(), 3);
  EXPECT_EQ(scene.views(0).view(), "left");
  EXPECT_EQ(scene.views(0).obstacle_pixels(), Block(0, 3).Count());
  EXPECT_EQ(scene.views(0).unknown_pixels(), RobotMask(0, 0, 0).Count());
  EXPECT_EQ(scene.views(0).foreground_pixels(), (Block(0, 3) | RobotMask(0, 0, 0)).Count());
  EXPECT_EQ(scene.views(1).obstacle_pixels(), 0u);
  EXPECT_FALSE(scene.views(0).has_scene());
}

TEST_F(SceneServiceTest, GetSceneGivesThePlanesThatWerePublished) {
  SceneInput input = SceneWithBlock(3);
  input.views[2].image = SceneMask{Mask(kViewSizes[2])};
  server.Publish(input);
  v1::Scene scene;
  ASSERT_TRUE(Get(0, true, &scene).ok());
  EXPECT_EQ(MaskOf(scene.views(0).scene()), Block(0, 3) | RobotMask(0, 0, 0));
  EXPECT_EQ(MaskOf(scene.views(0).obstacle()), Block(0, 3));
  EXPECT_EQ(MaskOf(scene.views(0).unknown()), RobotMask(0, 0, 0));
  EXPECT_TRUE(MaskOf(scene.views(0).error()).Empty());
  EXPECT_EQ(MaskOf(scene.views(2).error()), RobotMask(2, 0, 0));
  EXPECT_EQ(scene.views(2).core_error_pixels(), Core(RobotMask(2, 0, 0)).Count());
  ASSERT_TRUE(Get(1, false, &scene).ok());
  EXPECT_FALSE(scene.views(0).has_scene());
}

TEST_F(SceneServiceTest, SceneThatIsNotThereIsNotFound) {
  v1::Scene scene;
  EXPECT_EQ(Get(0, false, &scene).error_code(), grpc::StatusCode::NOT_FOUND);
  server.Publish(request);
  EXPECT_EQ(Get(2, false, &scene).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(Get(2, true, &scene).error_message(), "there is no scene 2, or no longer");
}

TEST_F(SceneServiceTest, CameraImagesAreDifferencedWithTheReference) {
  const Mask seen = RobotMask(0, 0, 0) | Block(0, 3);
  request.mutable_views(0)->set_camera_image(PngOf(CameraPicture(0, seen)));
  const v1::Scene scene = server.Publish(request);
  EXPECT_EQ(scene.defects_size(), 0);
  EXPECT_GE(scene.views(0).obstacle_pixels(), Block(0, 3).Count());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
}

TEST_F(SceneServiceTest, ReadyObstacleMasksLeaveTheRobotUnknown) {
  Set(Block(0, 3), request.mutable_views(0)->mutable_obstacle_mask());
  const v1::Scene scene = server.Publish(request);
  EXPECT_EQ(scene.views(0).obstacle_pixels(), Block(0, 3).Count());
  EXPECT_EQ(scene.views(0).unknown_pixels(), RobotMask(0, 0, 0).Count());
  EXPECT_EQ(scene.views(0).error_pixels(), 0u);
}

TEST_F(SceneServiceTest, StalenessIsTold) {
  server.Publish(request);
  server.clock.Advance(absl::Milliseconds(1500));
  v1::Scene scene;
  ASSERT_TRUE(Get(0, false, &scene).ok());
  ASSERT_EQ(scene.defects_size(), 1);
  EXPECT_EQ(scene.defects(0).reason(), v1::Verdict::REASON_SCENE_STALE);
  EXPECT_EQ(scene.defects(0).message(),
            "the oldest image is 1.5 s old, older than max_age, 1 s; publish a new scene");
}

TEST_F(SceneServiceTest, OlderImagesThanThoseServedAreRefused) {
  server.Publish(request);
  for (int i = 0; i < 3; ++i) {
    Set(server.clock.now() - absl::Milliseconds(20),
        request.mutable_views(i)->mutable_capture_time());
  }
  EXPECT_THAT(Refusal(grpc::StatusCode::FAILED_PRECONDITION), HasSubstr("older than"));
  EXPECT_EQ(server.Check({At(0, 0)}).basis().scene_id(), 1u);
}

TEST_F(SceneServiceTest, RefusesWhatSaysNothingOfTheCellNamingTheField) {
  request.mutable_views(1)->set_view("bottom");
  EXPECT_EQ(Refusal(),
            "views[1] 'bottom': the cell has no such view; its views are left, right, top");
  request.mutable_views(1)->set_view("left");
  EXPECT_EQ(Refusal(), "views[1] 'left': the view is given twice");
  request.mutable_views(1)->set_view("right");
  request.mutable_views(1)->clear_image();
  EXPECT_EQ(Refusal(), "views[1] 'right': give one of scene_mask, camera_image and obstacle_mask");
  request.mutable_views(1)->set_camera_image("no image");
  EXPECT_THAT(Refusal(), HasSubstr("views[1] 'right': the camera image cannot be decoded"));
  Set(Mask({12, 16}), request.mutable_views(1)->mutable_scene_mask());
  EXPECT_EQ(Refusal(), "views[1] 'right': the mask is 12x16, and should be 16x12");
  request.mutable_views(1)->mutable_scene_mask()->set_bits("few");
  EXPECT_THAT(Refusal(), HasSubstr("views[1] 'right'.scene_mask: "));
  request.mutable_views(1)->mutable_scene_mask()->set_width(-3);
  EXPECT_THAT(Refusal(), HasSubstr("views[1] 'right'.scene_mask: "));
  request.clear_views();
  EXPECT_THAT(Refusal(), HasSubstr("views: "));
}

TEST_F(SceneServiceTest, RefusesStrongPixelsThatItsMaskLacks) {
  const Mask one = Mask::FromPredicate({16, 12}, [](int x, int y) { return x == 3 && y == 4; });
  Set(Mask({16, 12}), request.mutable_views(1)->mutable_scene_mask());
  Set(one, request.mutable_views(1)->mutable_strong_mask());
  EXPECT_THAT(Refusal(), HasSubstr("strong_mask has pixels that scene_mask has not"));
  Set(Mask({12, 16}), request.mutable_views(1)->mutable_strong_mask());
  EXPECT_THAT(Refusal(), HasSubstr("strong_mask"));
  Set(one, request.mutable_views(1)->mutable_obstacle_mask());
  EXPECT_THAT(Refusal(), HasSubstr("strong_mask goes with scene_mask only"));
}

TEST_F(SceneServiceTest, RefusesTimesThatAreNoneOrInTheFuture) {
  auto& time = *request.mutable_views(2)->mutable_capture_time();
  Set(server.clock.now() + absl::Milliseconds(200), &time);
  EXPECT_THAT(Refusal(), HasSubstr("views[2] 'top': capture_time is 200 ms in the future"));
  time.set_nanos(1'000'000'000);
  EXPECT_THAT(Refusal(), HasSubstr("views[2] 'top'.capture_time"));
  time.set_nanos(0);
  time.set_seconds(std::numeric_limits<int64_t>::max());
  EXPECT_THAT(Refusal(), HasSubstr("views[2] 'top'.capture_time"));
}

TEST_F(SceneServiceTest, ImageWithoutATimeIsRefused) {
  request.mutable_views(1)->clear_capture_time();
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("views[1] 'right'"), HasSubstr("no capture time")));
  request.mutable_views(1)->mutable_server_clock();  // the clock begins at zero
  EXPECT_EQ(server.Publish(request).id(), 1u);
}

TEST(SceneService, ImageWithoutATimeIsAcceptedIfTheCellSaysSo) {
  ServingSettings settings;
  settings.scene.accept_arrival_times = true;
  TestServer server(NewDatabase(), settings);
  EXPECT_TRUE(server.PublishStatus(RequestOf(EmptyCellScene())).ok());
}

TEST_F(SceneServiceTest, HeldUpRequestIsAsOldAsItsImages) {
  for (const bool by_server_clock : {false, true}) {
    request = server.Stamped(RequestOf(EmptyCellScene()));
    for (v1::ViewImage& image : *request.mutable_views()) {
      if (!by_server_clock) continue;
      image.clear_capture_time();
      image.mutable_server_clock()->set_seconds(
          absl::ToInt64Seconds(server.clock.clock()().running));
    }
    server.clock.Advance(absl::Seconds(3));  // on its way
    server.Publish(request);
    const v1::CheckConfigurationsResponse response = server.Check({At(3, 0)});
    EXPECT_EQ(response.basis().scene_age().seconds(), 3) << by_server_clock;
    EXPECT_EQ(response.verdicts(0).reason(), v1::Verdict::REASON_SCENE_STALE) << by_server_clock;
  }
}

TEST_F(SceneServiceTest, ServerClockDecidesWhateverTheWallClocksAre) {
  for (const double set : {-60.0, -5.0, 5.0, 60.0}) {
    request =
        server.Stamped(RequestOf(EmptyCellScene()));  // the caller's wall clock stays as it is
    server.clock.Set(absl::Seconds(set));
    server.clock.Advance(absl::Milliseconds(250));
    for (v1::ViewImage& image : *request.mutable_views()) {
      *image.mutable_server_clock() = server.Check({}).basis().server_clock();
    }
    server.clock.Advance(absl::Milliseconds(20));
    EXPECT_EQ(server.Publish(request).defects_size(), 0) << set;
    const v1::CheckConfigurationsResponse response = server.Check({At(3, 0)});
    EXPECT_EQ(response.basis().scene_age().nanos(), 20'000'000) << set;
    EXPECT_EQ(response.verdicts(0).state(), v1::Verdict::STATE_FREE) << set;
    server.clock.Advance(absl::Milliseconds(990));
    EXPECT_EQ(server.CheckOne(At(3, 0)).reason(), v1::Verdict::REASON_SCENE_STALE) << set;
  }
}

TEST_F(SceneServiceTest, ServerClockInTheFutureOrOfNoTimeIsRefused) {
  request.mutable_views(1)->mutable_server_clock()->set_nanos(1);
  EXPECT_THAT(Refusal(grpc::StatusCode::OUT_OF_RANGE), HasSubstr("views[1] 'right'.server_clock"));
  for (const int64_t seconds :
       {std::numeric_limits<int64_t>::max(), std::numeric_limits<int64_t>::min()}) {
    request.mutable_views(1)->mutable_server_clock()->set_seconds(seconds);
    EXPECT_THAT(Refusal(), HasSubstr("views[1] 'right'.server_clock"));
  }
}

TEST_F(SceneServiceTest, WhatIsRefusedChangesNothing) {
  server.Publish(SceneWithBlock(3));
  request.mutable_views(1)->set_view("bottom");
  Refusal();
  EXPECT_EQ(server.Check({At(3, 0)}).basis().scene_id(), 1u);
  EXPECT_EQ(server.CheckOne(At(3, 0)).state(), v1::Verdict::STATE_OCCUPIED);
}

TEST_F(SceneServiceTest, RequestThatIsTooLargeIsRefused) {
  request.mutable_views(0)->set_camera_image(
      std::string(kMostBytes<v1::PublishSceneRequest> + 1, 'x'));
  EXPECT_EQ(server.PublishStatus(request).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

TEST(SceneService, CameraImagesWithoutReferencesAreRefused) {
  TestServer server(NewDatabase());
  v1::PublishSceneRequest request = server.Stamped(RequestOf(EmptyCellScene()));
  request.mutable_views(0)->set_camera_image(PngOf(CameraPicture(0, Mask(kViewSizes[0]))));
  const grpc::Status status = server.PublishStatus(request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("no reference images"));
}

}  // namespace
}  // namespace silhouette
