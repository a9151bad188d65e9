// SPDX-License-Identifier: Apache-2.0
// Questions of the collision service, and the checks that their answers must pass.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "silhouette/answers.h"
#include "silhouette/client.h"
#include "silhouette/running_clock.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette::client {

v1::CheckConfigurationsRequest QuestionOf(std::span<const Configuration> configurations,
                                          const Policy& policy, Evidence evidence,
                                          Clearance clearance);
v1::CheckPathRequest QuestionOf(std::span<const Configuration> waypoints, const Policy& policy,
                                Clearance clearance,
                                const std::optional<SeparationPolicy>& separation = std::nullopt);

// `address`: of the server, for errors; `asked`: when the question was sent. Internal if the answer
// does not fit the question, Unimplemented if it lacks clearances.
absl::StatusOr<ConfigurationChecks> AnswerFrom(const v1::CheckConfigurationsResponse& response,
                                               size_t configurations, Clearance clearance,
                                               RunningClock::time_point asked,
                                               const std::string& address);
absl::StatusOr<NumberChecks> NumbersFrom(const v1::CheckConfigurationsResponse& response,
                                         size_t numbers, RunningClock::time_point asked,
                                         const std::string& address);
absl::StatusOr<PathCheck> AnswerFrom(const v1::CheckPathResponse& response, Clearance clearance,
                                     RunningClock::time_point asked, const std::string& address);

// A variant was requested and the server knows none: it is older than this library.
absl::Status NoVariants(const std::string& address);

// Whether an answer with verdicts is about the cell of the connection (RequireSameCell) and uses
// the requested variant (NoVariants); an empty one fits any.
absl::Status RequireBasis(const std::string& variant, const v1::Basis& basis,
                          const Connection& connection);

// A separation was requested and the server reports none: it is older than this library.
absl::Status NoSeparation(const std::string& address);

// Clearances were requested and the server reports none: it is older than this library.
absl::Status NoClearances(const std::string& address);

}  // namespace silhouette::client
