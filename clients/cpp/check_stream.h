// SPDX-License-Identifier: Apache-2.0 Implementation of CheckStream.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "clients/cpp/connection.h"
#include "silhouette/check_stream.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette::client {

class CheckStream::Impl {
 public:
  Impl(std::shared_ptr<const Connection> connection, std::string variant);
  ~Impl();

  absl::Status Send(v1::StreamChecksRequest question);
  void EndQuestions();
  absl::StatusOr<StreamedAnswer> Receive();
  void Cancel();

 private:
  // A question that was sent.
  struct Question {
    uint64_t id = 0;
    std::optional<size_t> configurations;  // how many; nothing: it is about a path
    Clearance clearance = Clearance::kOmit;
    std::chrono::steady_clock::time_point asked;
  };

  void Begin();
  // Reads answers to the end of the call. Returns why it ended; OK if nothing is missing.
  absl::Status ReadAnswers();
  absl::StatusOr<StreamedAnswer> AnswerTo(const Question& question,
                                          const v1::StreamChecksResponse& response) const;
  void End(const absl::Status& status);

  const std::shared_ptr<const Connection> connection_;
  const std::string variant_;
  Cancellation cancellation_;
  grpc::ClientContext context_;
  std::optional<Cancellation::Call> call_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamChecksRequest, v1::StreamChecksResponse>>
      stream_;
  bool questions_ended_ = false;  // the sending thread's own

  std::mutex mutex_;
  std::condition_variable changed_;
  bool begun_ = false;  // there is a call, or will be at once
  std::deque<Question> unanswered_;
  std::deque<StreamedAnswer> answers_;  // that were not received
  size_t not_received_ = 0;             // questions, answered or not
  std::optional<absl::Status> ended_;
  std::jthread reader_;  // last: it uses the others
};

}  // namespace silhouette::client
