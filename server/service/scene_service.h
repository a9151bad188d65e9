// SceneService: what the owner of the cameras calls.
#pragma once

#include <mutex>

#include "server/service/serving.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette {

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

}  // namespace silhouette
