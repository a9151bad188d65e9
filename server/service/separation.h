// SPDX-License-Identifier: Apache-2.0
// Answers of speed and separation.
#pragma once

#include <span>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/stop.h"
#include "server/scene/checker.h"
#include "server/service/serving.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette {

// How fast the robot may follow the path, which has at least one waypoint. FailedPrecondition: the
// database serves no distances; InvalidArgument: the request's policy cannot be; ResourceExhausted:
// the path is too long; Cancelled: `cancelled` says so. Writes no level if verdicts are blocked by
// the time the answer is ready. Returns when that was, by the running clock: from then on it is
// valid for `valid_for`.
absl::StatusOr<absl::Duration> AnswerSeparation(const Serving& serving, const Checker& checker,
                                                std::span<const Configuration> waypoints,
                                                const v1::SeparationPolicy& request,
                                                const Stop& cancelled, v1::Separation* separation);

}  // namespace silhouette
