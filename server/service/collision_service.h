// CollisionService: what planners ask.
#pragma once

#include "absl/status/statusor.h"
#include "server/scene/checker.h"
#include "server/service/serving.h"
#include "silhouette/v1/collision_service.grpc.pb.h"

namespace silhouette {

// No reply says free unless a Checker of one database and one scene said so, and the scene was
// still good when the reply was ready.
class CollisionService final : public v1::CollisionService::CallbackService {
 public:
  // More is INVALID_ARGUMENT.
  static constexpr int kMaxConfigurations = 10'000;
  static constexpr int kMaxNumbers = 8'000'000;
  static constexpr int kMaxWaypoints = 10'000;
  static constexpr double kMaxPlaces = 1e6;

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
  grpc::ServerUnaryReactor* Explain(grpc::CallbackServerContext* context,
                                    const v1::ExplainRequest* request,
                                    v1::ExplainResponse* response) override;

 private:
  // CheckConfigurations by numbers.
  grpc::Status CheckNumbers(const v1::CheckConfigurationsRequest& request,
                            v1::CheckConfigurationsResponse* response);
  // The policy of a request. FailedPrecondition if the database cannot serve it.
  absl::StatusOr<Policy> PolicyFor(const v1::Policy& message, const ServedDatabase& database) const;
  // Whether even a few checks may take longer than look-ups: under the sound presets.
  bool MayTakeLong(const v1::Policy& message) const;
  // The world at this moment under the policy of a request.
  absl::StatusOr<Checker> CheckerFor(const v1::Policy& policy) const;
  // Tells what the answer rests on. Returns why it must not say free after all: the scene may have
  // become too old, or an allowed region ended, while the answer was made.
  Reason Conclude(const Served& served, const Policy& policy, v1::Basis* basis) const;

  Serving& serving_;
};

}  // namespace silhouette
