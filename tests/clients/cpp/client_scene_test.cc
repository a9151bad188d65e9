// SPDX-License-Identifier: Apache-2.0
// Scenes that a client publishes and reads, and the times of its images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include "silhouette/client.h"
#include "silhouette/messages.h"
#include "tests/clients/cpp/fake_server.h"

namespace silhouette::client {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(Scene, IsSentAndReadWhole) {
  FakeServer server;
  v1::PublishSceneRequest seen;
  server.check_configurations = [](auto&, auto&, auto&) { return grpc::Status::OK; };
  server.publish_scene = [&](auto&, const v1::PublishSceneRequest& request,
                             v1::PublishSceneResponse& response) {
    seen = request;
    v1::Scene& scene = *response.mutable_scene();
    scene.set_id(4);
    scene.set_variant(request.variant());
    *scene.mutable_joints() = request.joints();
    v1::SceneView& view = *scene.add_views();
    *view.mutable_scene() = request.views(0).scene_mask();
    *view.mutable_obstacle() = *view.mutable_unknown() = *view.mutable_error() = view.scene();
    scene.add_defects()->set_reason(v1::Verdict::REASON_VIEW_MISSING);
    return grpc::Status::OK;
  };
  const Mask mask = Mask::FromPredicate({5, 3}, [](int x, int y) { return x == 2 * y; });
  v1::PublishSceneRequest request;
  request.set_variant("tool");
  request.add_joints()->set_position(0.5);
  v1::ViewImage& image = *request.add_views();
  *image.mutable_scene_mask() = ToMessage(mask);
  *image.mutable_capture_time() = ToMessage(absl::FromUnixNanos(1'700'000'000'123'456'789));
  const auto scene = ClientOfHere(server).PublishScene(request);
  ASSERT_TRUE(scene.ok()) << scene.status();

  ASSERT_EQ(seen.views_size(), 1);
  EXPECT_EQ(seen.views(0).capture_time().seconds(), 1'700'000'000);
  EXPECT_EQ(seen.views(0).capture_time().nanos(), 123'456'789);
  EXPECT_EQ(seen.views(0).scene_mask().bits(), mask.ToBytes());
  EXPECT_EQ(scene->id(), 4u);
  EXPECT_EQ(scene->variant(), "tool");
  EXPECT_EQ(scene->joints(0).position(), 0.5);
  EXPECT_EQ(FromMessage(scene->views(0).scene()), mask);
  EXPECT_EQ(FromMessage(scene->defects(0).reason()), Reason::kViewMissing);
}

// A client that plans ahead with the part publishes the empty gripper as the empty gripper.
TEST(Scene, IsOfTheVariantThatItNamesWhateverTheClientChecks) {
  FakeServer server;
  std::string seen;
  server.check_configurations = [](auto&, auto&, auto&) { return grpc::Status::OK; };
  server.publish_scene = [&](auto&, const v1::PublishSceneRequest& request,
                             v1::PublishSceneResponse& response) {
    seen = request.variant();
    response.mutable_scene()->set_variant(seen);
    return grpc::Status::OK;
  };
  const Client client = ClientOfHere(server).WithVariant("with-part");
  v1::PublishSceneRequest request;
  for (const std::string shown : {"default", "tool"}) {
    request.set_variant(shown);
    ASSERT_TRUE(client.PublishScene(request).ok());
    EXPECT_EQ(seen, shown);
  }
  request.clear_variant();
  const absl::Status unnamed = client.PublishScene(request).status();
  EXPECT_TRUE(absl::IsInvalidArgument(unnamed)) << unnamed;
  EXPECT_THAT(std::string(unnamed.message()),
              AllOf(HasSubstr("checks 'with-part'"), HasSubstr("or 'default'")));
  EXPECT_EQ(seen, "tool") << "nothing more is published";
}

// A server whose clock shows `clock` when it answers; it keeps what is published.
struct ClockedServer {
  ClockedServer() {
    fake.check_configurations = [this](auto&, auto&, v1::CheckConfigurationsResponse& response) {
      ++round_trips;
      *response.mutable_basis()->mutable_server_clock() = ToMessage(Clock());
      return grpc::Status::OK;
    };
    fake.publish_scene = [this](auto&, const v1::PublishSceneRequest& request,
                                v1::PublishSceneResponse&) -> grpc::Status {
      std::this_thread::sleep_for(hold_up);
      for (const v1::ViewImage& image : request.views()) {
        if (FromMessage(image.server_clock()) > Clock()) {
          return {grpc::StatusCode::OUT_OF_RANGE, "the future"};
        }
      }
      seen = request;
      return grpc::Status::OK;
    };
  }
  absl::Duration Clock() const {
    return ahead + absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
  }
  absl::Duration ahead = absl::Hours(1000);
  std::atomic<int> round_trips = 0;
  std::chrono::milliseconds hold_up{0};
  v1::PublishSceneRequest seen;
  FakeServer fake;  // last: its handlers use the others
};

TEST(Scene, ImagesAreStampedByTheServersClockBeforeTheyAreSent) {
  ClockedServer server;
  server.hold_up = std::chrono::milliseconds(30);
  const Client client = ClientOfHere(server.fake);
  v1::PublishSceneRequest request;
  request.add_views()->set_view("top");
  *request.add_views()->mutable_capture_time() = ToMessage(absl::FromUnixSeconds(1'700'000'000));
  const absl::Duration called = server.Clock();
  ASSERT_TRUE(client.PublishScene(request, RunningClock::now()).ok());
  EXPECT_LE(FromMessage(server.seen.views(0).server_clock()), called + absl::Milliseconds(20));
  EXPECT_GE(FromMessage(server.seen.views(0).server_clock()), called - absl::Seconds(1));
  EXPECT_FALSE(server.seen.views(1).has_server_clock()) << "it has a time";
  EXPECT_EQ(server.seen.views(1).capture_time().seconds(), 1'700'000'000);
  const auto earlier = RunningClock::now() - std::chrono::seconds(3);
  ASSERT_TRUE(client.WithTimeout(absl::Seconds(5)).PublishScene(request, earlier).ok());
  EXPECT_LE(FromMessage(server.seen.views(0).server_clock()), server.Clock() - absl::Seconds(3));
  EXPECT_EQ(server.round_trips, 1 + 2)
      << "one a second for the clock, of all copies of the client, and one a scene for the cell";
}

TEST(Scene, IsStampedAgainWhenTheServersComputerWasRestarted) {
  ClockedServer server;
  const Client client = ClientOfHere(server.fake);
  v1::PublishSceneRequest request;
  request.add_views()->set_view("top");
  ASSERT_TRUE(client.PublishScene(request, RunningClock::now()).ok());
  server.ahead = absl::ZeroDuration();
  ASSERT_TRUE(client.PublishScene(request, RunningClock::now()).ok());
  EXPECT_LE(FromMessage(server.seen.views(0).server_clock()), server.Clock());
  EXPECT_EQ(server.round_trips, 2 + 3) << "for the clock, and for the cell before each attempt";
}

TEST(Scene, OfAServerThatReportsNoClockIsAnError) {
  FakeServer server;
  server.check_configurations = [](auto&, auto&, auto&) { return grpc::Status::OK; };
  v1::PublishSceneRequest request;
  request.add_views()->set_view("top");
  EXPECT_EQ(ClientOfHere(server).PublishScene(request, RunningClock::now()).status().code(),
            absl::StatusCode::kUnimplemented);
}

TEST(Scene, WithAnImageOfUnknownAgeOrFromTheFutureIsRefusedAndNotSent) {
  ClockedServer server;
  const Client client = ClientOfHere(server.fake);
  v1::PublishSceneRequest request;
  *request.add_views()->mutable_capture_time() = ToMessage(absl::Now());
  request.add_views()->set_view("top");
  const absl::Status undated = client.PublishScene(request).status();
  EXPECT_TRUE(absl::IsInvalidArgument(undated)) << undated;
  EXPECT_THAT(std::string(undated.message()), AllOf(HasSubstr("'top'"), HasSubstr("state taken")));
  const absl::Status future =
      client.PublishScene(request, RunningClock::now() + std::chrono::hours(1)).status();
  EXPECT_TRUE(absl::IsInvalidArgument(future)) << future;
  EXPECT_THAT(std::string(future.message()),
              AllOf(HasSubstr("in the future"), HasSubstr("RunningClock::now()")));
  EXPECT_EQ(server.seen.views_size(), 0);
  EXPECT_EQ(server.round_trips, 0);
}

TEST(Scene, WithAMaskThatCannotBeIsAnError) {
  using View = v1::SceneView;
  View view;  // of the next answer
  FakeServer server;
  server.get_scene = [&](auto&, auto&, v1::GetSceneResponse& response) {
    *response.mutable_scene()->add_views() = view;
    return grpc::Status::OK;
  };
  const Client client = ClientOfHere(server);
  const v1::Mask sound = ToMessage(Mask({8, 8}));
  // Alone, as `scene` comes without obstacles, and with all others.
  for (const bool alone : {true, false}) {
    for (const auto plane : {&View::mutable_scene, &View::mutable_obstacle, &View::mutable_unknown,
                             &View::mutable_error, &View::mutable_ignored, &View::mutable_strong}) {
      view.Clear();
      if (!alone) {
        *view.mutable_scene() = *view.mutable_obstacle() = *view.mutable_unknown() = sound;
        *view.mutable_error() = *view.mutable_ignored() = *view.mutable_strong() = sound;
        EXPECT_TRUE(client.GetScene().ok());
      }
      (view.*plane)()->set_width(8);
      (view.*plane)()->set_height(9);
      EXPECT_EQ(client.GetScene().status().code(), absl::StatusCode::kInternal)
          << view.ShortDebugString();
    }
  }
  view.Clear();
  *view.mutable_obstacle() = sound;
  EXPECT_EQ(client.GetScene().status().code(), absl::StatusCode::kInternal) << "without the others";
  view.Clear();
  *view.mutable_scene() = sound;
  EXPECT_TRUE(client.GetScene().ok());
}

TEST(SceneWatch, EndThatNoCancelAndNoDeadlineOfThisClientMadeIsALoss) {
  for (const auto code : {grpc::StatusCode::CANCELLED, grpc::StatusCode::DEADLINE_EXCEEDED}) {
    FakeServer server;
    server.watch_scenes = [code](auto&, auto&, auto&) {
      return grpc::Status(code, "ended by a proxy");
    };
    SceneWatch watch = ClientOfHere(server).WatchScenes();
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(watch.Next(absl::Seconds(20)).status().code(), absl::StatusCode::kUnavailable);
    }
  }
}

}  // namespace
}  // namespace silhouette::client
