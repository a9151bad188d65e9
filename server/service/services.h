// SPDX-License-Identifier: Apache-2.0
// The three gRPC services.
#pragma once

#include <mutex>

#include "server/service/serving.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette {

// CollisionService: what planners ask.
// No reply says free unless a Checker of one database and one scene said so, and the scene was
// still good when the reply was ready.
class CollisionService final : public v1::CollisionService::CallbackService {
 public:
  explicit CollisionService(Serving& serving) : serving_(serving) {}

  grpc::ServerUnaryReactor* CheckConfigurations(grpc::CallbackServerContext* context,
                                                const v1::CheckConfigurationsRequest* request,
                                                v1::CheckConfigurationsResponse* response) override;
  grpc::ServerUnaryReactor* CheckPath(grpc::CallbackServerContext* context,
                                      const v1::CheckPathRequest* request,
                                      v1::CheckPathResponse* response) override;
  grpc::ServerWriteReactor<v1::GetConfigurationSpaceResponse>* GetConfigurationSpace(
      grpc::CallbackServerContext* context,
      const v1::GetConfigurationSpaceRequest* request) override;
  grpc::ServerWriteReactor<v1::WatchConfigurationSpaceResponse>* WatchConfigurationSpace(
      grpc::CallbackServerContext* context,
      const v1::WatchConfigurationSpaceRequest* request) override;
  grpc::ServerWriteReactor<v1::WatchPathResponse>* WatchPath(
      grpc::CallbackServerContext* context, const v1::CheckPathRequest* request) override;
  grpc::ServerBidiReactor<v1::StreamChecksRequest, v1::StreamChecksResponse>* StreamChecks(
      grpc::CallbackServerContext* context) override;
  grpc::ServerUnaryReactor* Explain(grpc::CallbackServerContext* context,
                                    const v1::ExplainRequest* request,
                                    v1::ExplainResponse* response) override;

 private:
  Serving& serving_;
};

// SceneService: what the owner of the cameras calls.
class SceneService final : public v1::SceneService::CallbackService {
 public:
  explicit SceneService(Serving& serving) : serving_(serving) {}

  grpc::ServerUnaryReactor* PublishScene(grpc::CallbackServerContext* context,
                                         const v1::PublishSceneRequest* request,
                                         v1::PublishSceneResponse* response) override;
  grpc::ServerUnaryReactor* GetScene(grpc::CallbackServerContext* context,
                                     const v1::GetSceneRequest* request,
                                     v1::GetSceneResponse* response) override;
  grpc::ServerUnaryReactor* GetAcquisition(grpc::CallbackServerContext* context,
                                           const v1::GetAcquisitionRequest* request,
                                           v1::GetAcquisitionResponse* response) override;
  grpc::ServerUnaryReactor* ChangeVariant(grpc::CallbackServerContext* context,
                                          const v1::ChangeVariantRequest* request,
                                          v1::ChangeVariantResponse* response) override;
  grpc::ServerUnaryReactor* AllowRegion(grpc::CallbackServerContext* context,
                                        const v1::AllowRegionRequest* request,
                                        v1::AllowRegionResponse* response) override;
  grpc::ServerUnaryReactor* RevokeRegion(grpc::CallbackServerContext* context,
                                         const v1::RevokeRegionRequest* request,
                                         v1::RevokeRegionResponse* response) override;
  grpc::ServerUnaryReactor* ListAllowedRegions(grpc::CallbackServerContext* context,
                                               const v1::ListAllowedRegionsRequest* request,
                                               v1::ListAllowedRegionsResponse* response) override;

 private:
  Serving& serving_;
  std::mutex
      changing_variant_;  // held while a change is told, until scenes of before are withdrawn
};

// DatabaseService: what the served database is.
class DatabaseService final : public v1::DatabaseService::CallbackService {
 public:
  explicit DatabaseService(Serving& serving) : serving_(serving) {}

  grpc::ServerUnaryReactor* GetDatabase(grpc::CallbackServerContext* context,
                                        const v1::GetDatabaseRequest* request,
                                        v1::GetDatabaseResponse* response) override;

 private:
  Serving& serving_;
};

}  // namespace silhouette
