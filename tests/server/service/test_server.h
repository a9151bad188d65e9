// SPDX-License-Identifier: Apache-2.0
// A server in this process with the cell of test_cell.h, and its stubs.
#pragma once

#include <gmock/gmock.h>
#include <grpcpp/channel.h>
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/service/server.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"
#include "tests/server/test_cell.h"

namespace silhouette {

// A clock that stands still until it is moved.
class TestClock {
 public:
  Clock clock() {
    return [this] {
      const absl::Duration passed = absl::Nanoseconds(passed_ += each_);
      return Moment{absl::FromUnixSeconds(1'000'000) + passed + absl::Nanoseconds(set_.load()),
                    passed};
    };
  }
  absl::Time now() { return clock()().time; }
  void Advance(absl::Duration duration) { passed_ += absl::ToInt64Nanoseconds(duration); }
  // From then on every reading takes so long.
  void Run(absl::Duration each) { each_ = absl::ToInt64Nanoseconds(each); }
  // Sets the wall clock forward, or back.
  void Set(absl::Duration by) { set_ += absl::ToInt64Nanoseconds(by); }

 private:
  std::atomic<int64_t> set_ = 0;
  std::atomic<int64_t> passed_ = 0;
  std::atomic<int64_t> each_ = 0;
};

inline void Set(absl::Time time, google::protobuf::Timestamp* message) {
  const int64_t nanos = absl::ToUnixNanos(time);
  message->set_seconds(nanos / 1'000'000'000);
  message->set_nanos(static_cast<int32_t>(nanos % 1'000'000'000));
}

inline void Set(const Mask& mask, v1::Mask* message) {
  message->set_width(mask.width());
  message->set_height(mask.height());
  message->set_bits(mask.ToBytes());
}

inline void Set(const Configuration& q, v1::Configuration* message) {
  for (double position : q) message->add_positions(position);
}

// The message that publishes `input`.
inline v1::PublishSceneRequest RequestOf(const SceneInput& input) {
  v1::PublishSceneRequest request;
  request.set_variant(input.variant);
  for (const JointPosition& joint : input.joints) {
    v1::JointPosition& added = *request.add_joints();
    added.set_name(joint.name);
    added.set_position(joint.position);
  }
  for (const ViewInput& view : input.views) {
    v1::ViewImage& added = *request.add_views();
    added.set_view(view.view);
    if (view.captured) Set(view.captured->time, added.mutable_capture_time());
    if (const auto* scene = std::get_if<SceneMask>(&view.image)) {
      Set(scene->mask, added.mutable_scene_mask());
    } else if (const auto* obstacles = std::get_if<ObstacleMask>(&view.image)) {
      Set(obstacles->mask, added.mutable_obstacle_mask());
    } else {
      added.set_camera_image(std::get<EncodedImage>(view.image).bytes);
    }
  }
  return request;
}

// Allows obstacles where `block` has them.
inline v1::AllowRegionRequest RegionAt(const std::string& name, int a, absl::Duration duration,
                                       Mask (*block)(int view, int a) = Block) {
  v1::AllowRegionRequest request;
  request.set_name(name);
  for (int view = 0; view < 3; ++view) {
    v1::RegionPixels& pixels = *request.add_views();
    pixels.set_view(kViewNames[static_cast<size_t>(view)]);
    Set(block(view, a), pixels.mutable_mask());
  }
  absl::Duration rest;
  request.mutable_duration()->set_seconds(absl::IDivDuration(duration, absl::Seconds(1), &rest));
  request.mutable_duration()->set_nanos(static_cast<int32_t>(absl::ToInt64Nanoseconds(rest)));
  return request;
}

inline v1::Policy PolicyNamed(const std::string& preset) {
  v1::Policy policy;
  policy.set_preset(preset);
  return policy;
}

class TestServer {
 public:
  // `wrap` may put something around the test clock.
  explicit TestServer(
      std::shared_ptr<const ServedDatabase> database, ServingSettings settings = {},
      const std::function<Clock(Clock)>& wrap = [](Clock inner) { return inner; }) {
    settings.clock = now_ = wrap(clock.clock());
    auto started = Server::Start("unix:" + (folder_ / "s").string(), std::move(database), settings);
    EXPECT_TRUE(started.ok()) << started.status();
    server = *std::move(started);
    channel = grpc::CreateChannel(server->address(), grpc::InsecureChannelCredentials());
    collision = v1::CollisionService::NewStub(channel);
  }

  v1::Scene Publish(const SceneInput& input) { return Publish(Stamped(RequestOf(input))); }
  v1::Scene Publish(const v1::PublishSceneRequest& request) {
    return Ask(&v1::SceneService::Stub::PublishScene, request).scene();
  }
  // The request with the present time for images that state none.
  v1::PublishSceneRequest Stamped(v1::PublishSceneRequest request) {
    for (v1::ViewImage& image : *request.mutable_views()) {
      if (!image.has_capture_time()) Set(now_().time, image.mutable_capture_time());
    }
    return request;
  }
  grpc::Status PublishStatus(const v1::PublishSceneRequest& request) {
    v1::PublishSceneResponse response;
    return Call(&v1::SceneService::Stub::PublishScene, request, &response);
  }
  v1::GetDatabaseResponse GetDatabase() {
    return Ask(&v1::DatabaseService::Stub::GetDatabase, v1::GetDatabaseRequest());
  }

  // Allows obstacles on the way of joint a at `a` (Block or HighBlock), in all views.
  void Allow(const std::string& name, int a, absl::Duration duration,
             Mask (*block)(int view, int a) = Block) {
    Ask(&v1::SceneService::Stub::AllowRegion, RegionAt(name, a, duration, block));
  }

  v1::CheckConfigurationsResponse Check(const std::vector<Configuration>& configurations,
                                        const v1::Policy& policy = {}, bool clearance = false) {
    v1::CheckConfigurationsRequest request;
    for (const Configuration& q : configurations) Set(q, request.add_configurations());
    *request.mutable_policy() = policy;
    request.set_include_clearance(clearance);
    const auto response = Ask(&v1::CollisionService::Stub::CheckConfigurations, request);
    EXPECT_EQ(response.verdicts_size(), static_cast<int>(configurations.size()));
    return response;
  }
  v1::Verdict CheckOne(const Configuration& q, const v1::Policy& policy = {}) {
    return Check({q}, policy).verdicts(0);
  }
  v1::CheckPathResponse Path(const std::vector<Configuration>& waypoints, bool clearance = false) {
    v1::CheckPathRequest request;
    for (const Configuration& q : waypoints) Set(q, request.add_waypoints());
    request.set_include_clearance(clearance);
    return Ask(&v1::CollisionService::Stub::CheckPath, request);
  }
  v1::ExplainResponse Explain(const Configuration& q) {
    v1::ExplainRequest request;
    Set(q, request.mutable_configuration());
    return Ask(&v1::CollisionService::Stub::Explain, request);
  }
  v1::CheckConfigurationsResponse CheckNumbers(const std::vector<uint32_t>& numbers) {
    v1::CheckConfigurationsRequest request;
    request.mutable_numbers()->Add(numbers.begin(), numbers.end());
    return Ask(&v1::CollisionService::Stub::CheckConfigurations, request);
  }

  std::vector<v1::GetConfigurationSpaceResponse> Space(
      const v1::GetConfigurationSpaceRequest& request = {}) {
    std::vector<v1::GetConfigurationSpaceResponse> messages;
    const grpc::Status status = Call(request, &messages);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return messages;
  }

  grpc::Status Call(const v1::CheckConfigurationsRequest& request,
                    v1::CheckConfigurationsResponse* response) {
    return Call(&v1::CollisionService::Stub::CheckConfigurations, request, response);
  }
  grpc::Status Call(const v1::CheckPathRequest& request, v1::CheckPathResponse* response) {
    return Call(&v1::CollisionService::Stub::CheckPath, request, response);
  }
  grpc::Status Call(const v1::ExplainRequest& request, v1::ExplainResponse* response) {
    return Call(&v1::CollisionService::Stub::Explain, request, response);
  }
  // One unary call.
  template <typename Stub, typename Request, typename Response>
  grpc::Status Call(grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                    const Request& request, Response* response) {
    grpc::ClientContext context;
    return (Stub(channel).*method)(&context, request, response);
  }
  // The same, which must succeed.
  template <typename Stub, typename Request, typename Response>
  Response Ask(grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
               const Request& request) {
    Response response;
    const grpc::Status status = Call(method, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }
  grpc::Status Call(const v1::GetConfigurationSpaceRequest& request,
                    std::vector<v1::GetConfigurationSpaceResponse>* messages) {
    grpc::ClientContext context;
    const auto reader = collision->GetConfigurationSpace(&context, request);
    v1::GetConfigurationSpaceResponse message;
    while (reader->Read(&message)) messages->push_back(message);
    return reader->Finish();
  }

  TestClock clock;

 private:
  Clock now_;  // of the server
  const std::filesystem::path folder_ = FreshFolder();

 public:
  std::unique_ptr<Server> server;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::CollisionService::Stub> collision;
};

}  // namespace silhouette
