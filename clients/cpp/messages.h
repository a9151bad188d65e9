// SPDX-License-Identifier: Apache-2.0 Conversions between the API's messages and the values of the
// client library. Malformed messages are Internal; the error names the fault.
#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "silhouette/answers.h"
#include "silhouette/configuration_space.h"
#include "silhouette/database.h"
#include "silhouette/policy.h"
#include "silhouette/region.h"
#include "silhouette/scene.h"
#include "silhouette/v1/collision_service.pb.h"
#include "silhouette/v1/database_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

v1::Configuration ToMessage(const Configuration& configuration);
v1::Policy ToMessage(const Policy& policy);
v1::ViewImage ToMessage(const ViewImage& image);
v1::RegionPixels ToMessage(const RegionPixels& pixels);
google::protobuf::Duration ToMessage(absl::Duration duration);
absl::Duration FromMessage(const google::protobuf::Duration& duration);
absl::Time FromMessage(const google::protobuf::Timestamp& time);

// `asked`: when the question was sent, or another time before the answer was made.
Basis FromMessage(const v1::Basis& basis, std::chrono::steady_clock::time_point asked);
// A free verdict without a scene becomes unknown.
Verdict FromMessage(const v1::Verdict& verdict, const Basis& basis);
// An unknown reason of a newer server becomes kUnspecified.
Reason FromMessage(v1::Verdict::Reason reason);
absl::StatusOr<ConfigurationGrid> FromMessage(const v1::Grid& grid);
absl::StatusOr<ConfigurationSpaceTile> FromMessage(const v1::ConfigurationSpaceTile& tile);
absl::StatusOr<Scene> FromMessage(const v1::Scene& scene);
absl::StatusOr<AllowedRegion> FromMessage(const v1::AllowedRegion& region);
absl::StatusOr<Database> FromMessage(const v1::GetDatabaseResponse& database);

}  // namespace silhouette::client
