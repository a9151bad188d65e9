// CollisionService: what planners ask.
#pragma once

#include "server/service/serving.h"
#include "silhouette/v1/collision_service.grpc.pb.h"

namespace silhouette {

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

}  // namespace silhouette
