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

// An answer that may have been on its way for longer than this says nothing: until it came, the
// scene grew older, and the server's max_age does not count that.
inline constexpr absl::Duration kLongestOnItsWay = absl::Milliseconds(500);

// Of an answer that has just arrived: when the server made it, at the earliest, and how long it was
// on its way since then, at most. If it took longer than kLongestOnItsWay since `asked`, a round
// trip tells the way from time that the server worked.
struct Arrival {
  RunningClock::time_point made;
  absl::Duration way;

  bool late() const { return way > kLongestOnItsWay; }
};
Arrival ArrivalOf(const v1::Basis& basis, RunningClock::time_point asked, ServerClock& clock);

// Makes unknown what a late answer says, kAnswerLate, and has its basis say so.
void DropIfLate(const Arrival& arrival, Basis& basis);
void DropIfLate(const Arrival& arrival, ConfigurationChecks& checks);
void DropIfLate(const Arrival& arrival, NumberChecks& checks);
void DropIfLate(const Arrival& arrival, PathCheck& check);
void DropIfLate(const Arrival& arrival, Explanation& explanation);
template <typename Answer>
absl::StatusOr<Answer> UnlessLate(const Arrival& arrival, absl::StatusOr<Answer> answer) {
  if (answer.ok()) DropIfLate(arrival, *answer);
  return answer;
}

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
