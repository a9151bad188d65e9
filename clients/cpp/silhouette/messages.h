// SPDX-License-Identifier: Apache-2.0
// Between messages of the API and values of this library: for who publishes scenes, allows regions
// or reads what the server reports.
#pragma once

#include <stdexcept>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "silhouette/answers.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/configuration_space.h"
#include "silhouette/mask.h"
#include "silhouette/policy.h"
#include "silhouette/running_clock.h"
#include "silhouette/v1/collision_service.pb.h"
#include "silhouette/v1/database_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

v1::Configuration ToMessage(const Configuration& configuration);
v1::Policy ToMessage(const Policy& policy);
v1::Mask ToMessage(const Mask& mask);
google::protobuf::Timestamp ToMessage(absl::Time time);
google::protobuf::Duration ToMessage(absl::Duration duration);

Policy FromMessage(const v1::Policy& policy);
// Throws std::invalid_argument if the mask has not as many bits as its size says.
Mask FromMessage(const v1::Mask& mask);
absl::Time FromMessage(const google::protobuf::Timestamp& time);
absl::Duration FromMessage(const google::protobuf::Duration& duration);
// `asked`: when the question was sent, or another time before the answer was made.
Basis FromMessage(const v1::Basis& basis, RunningClock::time_point asked);
// A free verdict without a scene becomes unknown.
Verdict FromMessage(const v1::Verdict& verdict, const Basis& basis);
// An unknown reason of a newer server becomes kUnspecified.
Reason FromMessage(v1::Verdict::Reason reason);
// Internal, and what is wrong, if there can be no such grid or tile.
absl::StatusOr<ConfigurationGrid> FromMessage(const v1::Grid& grid);
absl::StatusOr<ConfigurationSpaceTile> FromMessage(const v1::ConfigurationSpaceTile& tile);

}  // namespace silhouette::client
