// SPDX-License-Identifier: Apache-2.0
// Questions of the collision service, and the checks that their answers must pass.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "clients/cpp/server_clock.h"
#include "silhouette/answers.h"
#include "silhouette/client.h"
#include "silhouette/running_clock.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette::client {

v1::CheckConfigurationsRequest QuestionOf(std::span<const Configuration> configurations,
                                          const Policy& policy, Evidence evidence,
                                          Clearance clearance);
v1::CheckPathRequest QuestionOf(std::span<const Configuration> waypoints, const Policy& policy,
                                Clearance clearance, std::optional<double> resolution,
                                const std::optional<SeparationPolicy>& separation = std::nullopt);

// `address`: of the server, for errors; `asked`: as Basis::asked. Internal if the answer
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

// The earliest time at which the server can have made an answer that has just arrived: when the
// question was sent, unless the answer would be valid no more since then, or its separation for
// less than half of its time. Then a round trip tells the way of the answer from the time that the
// server worked.
RunningClock::time_point MadeAt(const v1::Basis& basis, RunningClock::time_point asked,
                                ServerClock& clock, const v1::Separation& separation = {});

// Makes the verdict unknown for this reason, with no place and no proof. Basis and separation stay.
void MakeUnknown(PathCheck& check, Reason reason);

// Whether an answer expired before it came; then its basis says so, and all verdicts of it become
// unknown, kAnswerLate.
bool DropIfExpired(Basis& basis);
void DropIfExpired(ConfigurationChecks& checks);
void DropIfExpired(NumberChecks& checks);
void DropIfExpired(PathCheck& check);
void DropIfExpired(Explanation& explanation);
template <typename Answer>
absl::StatusOr<Answer> UnlessExpired(absl::StatusOr<Answer> answer) {
  if (answer.ok()) DropIfExpired(*answer);
  return answer;
}

// A variant was requested and the server knows none: it is older than this library.
absl::Status NoVariants(const std::string& address);

// Whether an answer with verdicts is about the cell of the connection (RequireSameCell), uses the
// requested variant (NoVariants; an empty one fits any), and states how long it is valid
// (Unimplemented: the server is older than this library).
absl::Status RequireBasis(const std::string& variant, const v1::Basis& basis,
                          const Connection& connection);

// A separation was requested and the server reports none: it is older than this library.
absl::Status NoSeparation(const std::string& address);

// Clearances were requested and the server reports none: it is older than this library.
absl::Status NoClearances(const std::string& address);

}  // namespace silhouette::client
