// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/running_server.h"

#include <grpcpp/create_channel.h>

#include <stdexcept>
#include <utility>

#include "absl/time/clock.h"

namespace silhouette::benchmarks {

void Require(bool ok, const std::string& what) {
  if (!ok) throw std::runtime_error(what);
}

RunningServer::RunningServer(const std::string& address, const SyntheticCell& cell,
                             std::shared_ptr<const ServedDatabase> database) {
  ServingSettings settings;
  settings.scene.max_age = absl::Hours(24);
  auto started = Server::Start(address, std::move(database), settings);
  Require(started.ok(), std::string(started.status().message()));
  server_ = *std::move(started);
  channel_ = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
  Publish(RequestOf(cell, MakeScene(cell, SceneKind::kPerson, 1)));
}

v1::PublishSceneRequest RunningServer::RequestOf(const SyntheticCell& cell,
                                                 const BenchmarkScene& scene) {
  v1::PublishSceneRequest request;
  for (size_t joint = 0; joint < scene.robot.size(); ++joint) {
    v1::JointPosition& added = *request.add_joints();
    added.set_name(cell.grid().joints()[joint].name);
    added.set_position(scene.robot[joint]);
  }
  for (int view = 0; view < kViews; ++view) {
    v1::ViewImage& added = *request.add_views();
    added.set_view("view_" + std::to_string(view + 1));
    const timespec now = absl::ToTimespec(absl::Now());
    added.mutable_capture_time()->set_seconds(now.tv_sec);
    added.mutable_capture_time()->set_nanos(static_cast<int32_t>(now.tv_nsec));
    const ObstacleImage& image = *scene.images[static_cast<size_t>(view)];
    const Mask foreground = image.obstacle() | image.unknown();
    added.mutable_scene_mask()->set_width(foreground.width());
    added.mutable_scene_mask()->set_height(foreground.height());
    added.mutable_scene_mask()->set_bits(foreground.ToBytes());
  }
  return request;
}

void RunningServer::Publish(const v1::PublishSceneRequest& request) {
  grpc::ClientContext context;
  v1::PublishSceneResponse response;
  const grpc::Status status =
      v1::SceneService::NewStub(channel_)->PublishScene(&context, request, &response);
  Require(status.ok(), status.error_message());
}

}  // namespace silhouette::benchmarks
