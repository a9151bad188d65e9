// SPDX-License-Identifier: Apache-2.0
// A server that says what a test tells it to say: well-formed answers or broken ones.
#pragma once

#include <grpcpp/grpcpp.h>

#include <functional>
#include <memory>
#include <string>

#include "silhouette/client.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette {

// One method: answers with what the handler says, UNIMPLEMENTED without one.
template <typename Request, typename Response>
using Handler = std::function<grpc::Status(grpc::ServerContext&, const Request&, Response&)>;

struct FakeServer final : v1::CollisionService::Service,
                          v1::SceneService::Service,
                          v1::DatabaseService::Service {
  // Listens at `at`, or on a free port of 127.0.0.1.
  explicit FakeServer(const std::string& at = "127.0.0.1:0") {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort(at, grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(static_cast<v1::CollisionService::Service*>(this));
    builder.RegisterService(static_cast<v1::SceneService::Service*>(this));
    builder.RegisterService(static_cast<v1::DatabaseService::Service*>(this));
    server = builder.BuildAndStart();
    address = at.starts_with("unix:") ? at : "127.0.0.1:" + std::to_string(port);
  }
  ~FakeServer() override { Stop(); }

  void Stop() {
    if (server != nullptr) server->Shutdown(std::chrono::system_clock::now());
    server = nullptr;
  }

  template <typename Request, typename Response>
  static grpc::Status Answer(const Handler<Request, Response>& handler,
                             grpc::ServerContext* context, const Request* request,
                             Response* response) {
    if (!handler) return {grpc::StatusCode::UNIMPLEMENTED, "not in this fake"};
    return handler(*context, *request, *response);
  }

  grpc::Status CheckConfigurations(grpc::ServerContext* context,
                                   const v1::CheckConfigurationsRequest* request,
                                   v1::CheckConfigurationsResponse* response) override {
    return Answer(check_configurations, context, request, response);
  }
  grpc::Status CheckPath(grpc::ServerContext* context, const v1::CheckPathRequest* request,
                         v1::CheckPathResponse* response) override {
    return Answer(check_path, context, request, response);
  }
  grpc::Status Explain(grpc::ServerContext* context, const v1::ExplainRequest* request,
                       v1::ExplainResponse* response) override {
    return Answer(explain, context, request, response);
  }
  grpc::Status GetConfigurationSpace(
      grpc::ServerContext* context, const v1::GetConfigurationSpaceRequest* request,
      grpc::ServerWriter<v1::GetConfigurationSpaceResponse>* writer) override {
    return Answer(configuration_space, context, request, writer);
  }
  grpc::Status WatchConfigurationSpace(
      grpc::ServerContext* context, const v1::WatchConfigurationSpaceRequest* request,
      grpc::ServerWriter<v1::WatchConfigurationSpaceResponse>* writer) override {
    return Answer(watch_space, context, request, writer);
  }
  grpc::Status WatchPath(grpc::ServerContext* context, const v1::CheckPathRequest* request,
                         grpc::ServerWriter<v1::WatchPathResponse>* writer) override {
    return Answer(watch_path, context, request, writer);
  }
  grpc::Status StreamChecks(grpc::ServerContext* context,
                            grpc::ServerReaderWriter<v1::StreamChecksResponse,
                                                     v1::StreamChecksRequest>* stream) override {
    if (!stream_checks) return {grpc::StatusCode::UNIMPLEMENTED, "not in this fake"};
    return stream_checks(*context, *stream);
  }
  grpc::Status PublishScene(grpc::ServerContext* context, const v1::PublishSceneRequest* request,
                            v1::PublishSceneResponse* response) override {
    return Answer(publish_scene, context, request, response);
  }
  grpc::Status GetScene(grpc::ServerContext* context, const v1::GetSceneRequest* request,
                        v1::GetSceneResponse* response) override {
    return Answer(get_scene, context, request, response);
  }
  grpc::Status WatchScenes(grpc::ServerContext* context, const v1::WatchScenesRequest* request,
                           grpc::ServerWriter<v1::WatchScenesResponse>* writer) override {
    return Answer(watch_scenes, context, request, writer);
  }
  grpc::Status GetDatabase(grpc::ServerContext* context, const v1::GetDatabaseRequest* request,
                           v1::GetDatabaseResponse* response) override {
    return Answer(get_database, context, request, response);
  }

  Handler<v1::CheckConfigurationsRequest, v1::CheckConfigurationsResponse> check_configurations;
  Handler<v1::CheckPathRequest, v1::CheckPathResponse> check_path;
  Handler<v1::ExplainRequest, v1::ExplainResponse> explain;
  Handler<v1::GetConfigurationSpaceRequest, grpc::ServerWriter<v1::GetConfigurationSpaceResponse>>
      configuration_space;
  Handler<v1::WatchConfigurationSpaceRequest,
          grpc::ServerWriter<v1::WatchConfigurationSpaceResponse>>
      watch_space;
  Handler<v1::CheckPathRequest, grpc::ServerWriter<v1::WatchPathResponse>> watch_path;
  std::function<grpc::Status(
      grpc::ServerContext&,
      grpc::ServerReaderWriter<v1::StreamChecksResponse, v1::StreamChecksRequest>&)>
      stream_checks;
  Handler<v1::PublishSceneRequest, v1::PublishSceneResponse> publish_scene;
  Handler<v1::GetSceneRequest, v1::GetSceneResponse> get_scene;
  Handler<v1::WatchScenesRequest, grpc::ServerWriter<v1::WatchScenesResponse>> watch_scenes;
  Handler<v1::GetDatabaseRequest, v1::GetDatabaseResponse> get_database;

  std::string address;
  std::unique_ptr<grpc::Server> server;
};

namespace client {

inline Client ClientOfHere(const FakeServer& server, absl::Duration timeout = absl::Seconds(20)) {
  return Client::Connect(server.address, timeout).value();
}

}  // namespace client
}  // namespace silhouette
