// SPDX-License-Identifier: Apache-2.0
// Pipelined checks over one call: many questions may be in flight at once.
//
//   silhouette::client::CheckStream stream = client->StreamChecks();
//   stream.Send(1, {{0.1, 0.2}});
//   stream.Send(2, {{0.1, 0.3}, {0.1, 0.4}});
//   const auto answer = stream.Receive();                        // to question 1
//   if (answer.ok() && answer->checks.ok() && answer->checks->AllFree()) ...
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "silhouette/answers.h"
#include "silhouette/policy.h"

namespace silhouette::client {

// The answer to one question.
struct StreamedAnswer {
  uint64_t id = 0;  // of the question
  // What CheckConfigurations would have returned. FailedPrecondition: the question was another.
  absl::StatusOr<ConfigurationChecks> checks;
  // What CheckPath would have returned, likewise.
  absl::StatusOr<PathCheck> path;
};

// One call, made with the first question. Answers come in the order of the questions; each uses the
// newest scene at the time of the answer. A question that cannot be answered does not end the call.
//
// One thread may send while another receives; Cancel() may be called by any. Answers that were not
// received wait in memory, so that sending never waits for receiving.
class CheckStream {
 public:
  // Most questions whose answers were not received yet.
  static constexpr size_t kMostUnanswered = 10'000;

  // Ends the call; waits for no server.
  ~CheckStream();
  CheckStream(CheckStream&&) noexcept;
  CheckStream& operator=(CheckStream&&) noexcept;

  // Asks as Client::CheckConfigurations and CheckPath do. `id`: chosen by the caller. Waits while
  // the server accepts no more. ResourceExhausted if kMostUnanswered is reached: receive some
  // first. FailedPrecondition after EndQuestions(). Any other error: the call is over.
  absl::Status Send(uint64_t id, std::span<const Configuration> configurations,
                    const Policy& policy = {}, Evidence evidence = Evidence::kOmit,
                    Clearance clearance = Clearance::kOmit);
  absl::Status Send(uint64_t id, std::initializer_list<Configuration> configurations,
                    const Policy& policy = {}, Evidence evidence = Evidence::kOmit,
                    Clearance clearance = Clearance::kOmit) {
    return Send(id, std::span(configurations.begin(), configurations.size()), policy, evidence,
                clearance);
  }
  absl::Status SendPath(uint64_t id, std::span<const Configuration> waypoints,
                        const Policy& policy = {}, Clearance clearance = Clearance::kOmit,
                        std::optional<double> resolution = {});

  // Announces the end of the questions: Receive() ends after the last answer. To be called by the
  // sending thread.
  void EndQuestions();

  // Waits for the next answer. OutOfRange when all were received after EndQuestions(). Cancelled
  // after Cancel(). Any other error, as in Client: the call is over, and every later Receive()
  // fails, too. Questions without an answer are unknown.
  absl::StatusOr<StreamedAnswer> Receive();

  // Ends the call, and any waiting Send or Receive.
  void Cancel();

 private:
  friend class Client;
  class Impl;
  explicit CheckStream(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace silhouette::client
