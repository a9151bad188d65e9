// SPDX-License-Identifier: Apache-2.0
#include "silhouette/check_stream.h"

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "clients/cpp/check_answers.h"
#include "clients/cpp/connection.h"
#include "clients/cpp/server_clock.h"
#include "silhouette/client.h"
#include "silhouette/messages.h"

namespace silhouette::client {
namespace {

absl::Status NotAsked() { return absl::FailedPreconditionError("the question was another one"); }

}  // namespace

class CheckStream::Impl {
 public:
  Impl(std::shared_ptr<const Connection> connection, absl::Duration timeout, std::string variant)
      : connection_(std::move(connection)), timeout_(timeout), variant_(std::move(variant)) {
    call_.emplace(cancellation_, context_);
  }

  ~Impl() {
    Cancel();
    if (reader_.joinable()) reader_.join();
    call_.reset();
  }

  absl::Status Send(v1::StreamChecksRequest question) {
    if (absl::Status usable = RequireCallable(timeout_); !usable.ok()) return usable;
    if (questions_ended_) {
      return absl::FailedPreconditionError("nothing can be asked after EndQuestions()");
    }
    const bool path = question.has_path();
    if (path) {
      question.mutable_path()->set_variant(variant_);
    } else {
      question.mutable_configurations()->set_variant(variant_);
    }
    const auto clearance_of = [](const auto& request) {
      return request.include_clearance() ? Clearance::kMeasure : Clearance::kOmit;
    };
    Question sent{
        .id = question.id(),
        .configurations = std::nullopt,
        .clearance = path ? clearance_of(question.path()) : clearance_of(question.configurations()),
        .asked = RunningClock::now()};
    if (!path) {
      sent.configurations = static_cast<size_t>(question.configurations().configurations_size());
    }
    bool first = false;
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return *ended_;
      if (not_received_ >= kMostUnanswered) {
        return absl::ResourceExhaustedError(absl::StrCat(
            "there are ", kMostUnanswered, " questions whose answers were not received"));
      }
      unanswered_.push_back(sent);
      ++not_received_;
      first = !std::exchange(begun_, true);
    }
    if (first) Begin();
    if (stream_->Write(question)) return absl::OkStatus();
    // The reader finds out why it failed.
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ended_.has_value(); });
    return *ended_;
  }

  void EndQuestions() {
    if (std::exchange(questions_ended_, true)) return;
    if (stream_ == nullptr) return End(absl::OkStatus());
    stream_->WritesDone();
  }

  absl::StatusOr<StreamedAnswer> Receive() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !answers_.empty() || ended_; });
    // After a loss or a cancellation no answer is returned.
    if (ended_ && ended_->code() != absl::StatusCode::kOutOfRange) return *ended_;
    if (answers_.empty()) return *ended_;
    StreamedAnswer answer = std::move(answers_.front());
    answers_.pop_front();
    --not_received_;
    if (answer.checks.ok()) DropIfExpired(*answer.checks);
    if (answer.path.ok()) DropIfExpired(*answer.path);
    return answer;
  }

  void Cancel() {
    cancellation_.Cancel();
    {
      const std::lock_guard lock(mutex_);
      if (begun_ || ended_) return;  // the end of the call reports it
    }
    End(absl::CancelledError());
  }

 private:
  // A question that was sent.
  struct Question {
    uint64_t id = 0;
    std::optional<size_t> configurations;  // how many; nothing: it is about a path
    Clearance clearance = Clearance::kOmit;
    RunningClock::time_point asked;
  };

  void Begin() {
    stream_ = connection_->collisions().StreamChecks(&context_);
    clock_.emplace(connection_, absl::Seconds(1), cancellation_);
    reader_ = std::jthread([this] { End(ReadAnswers()); });
  }

  // Reads answers to the end of the call. Returns why it ended; OK if nothing is missing.
  absl::Status ReadAnswers() {
    const absl::Status ended = connection_->ReadAll<v1::StreamChecksResponse>(
        *stream_, context_, absl::InfiniteDuration(),
        [this](const auto& response) { return Take(response); });
    if (!ended.ok()) return ended;
    const std::lock_guard lock(mutex_);
    if (unanswered_.empty()) return absl::OkStatus();
    return Malformed(connection_->address(),
                     absl::StrCat("it left ", unanswered_.size(), " questions unanswered"));
  }

  // Takes the answer to the oldest question. Returns an error if the call must end.
  absl::Status Take(const v1::StreamChecksResponse& response) {
    Question question;
    {
      const std::lock_guard lock(mutex_);
      if (unanswered_.empty()) {
        return Malformed(connection_->address(), "it answers a question that was not asked");
      }
      question = unanswered_.front();
      unanswered_.pop_front();
    }
    absl::StatusOr<StreamedAnswer> answer = AnswerTo(question, response);
    if (!answer.ok()) return answer.status();
    {
      const std::lock_guard lock(mutex_);
      answers_.push_back(*std::move(answer));
    }
    changed_.notify_all();
    return absl::OkStatus();
  }

  absl::StatusOr<StreamedAnswer> AnswerTo(const Question& question,
                                          const v1::StreamChecksResponse& response) {
    const std::string& address = connection_->address();
    if (response.id() != question.id) {
      return Malformed(address, absl::StrCat("it answers question ", response.id(), " instead of ",
                                             question.id));
    }
    StreamedAnswer answer{.id = question.id, .checks = NotAsked(), .path = NotAsked()};
    absl::Status error;
    if (response.has_configurations() || response.has_path()) {
      error = RequireBasis(
          variant_,
          response.has_path() ? response.path().basis() : response.configurations().basis(),
          *connection_);
      if (absl::IsFailedPrecondition(error)) return error;
    }
    if (response.has_error()) {
      const auto code = static_cast<grpc::StatusCode>(response.error().code());
      if (code == grpc::StatusCode::OK) return Malformed(address, "an error is none");
      error = connection_->SentenceFor(grpc::Status(code, response.error().message()),
                                       absl::InfiniteDuration());
    }
    if (question.configurations.has_value()) {
      if (error.ok() && !response.has_configurations()) {
        return Malformed(address, "it is not the answer to a question about configurations");
      }
      if (!error.ok()) {
        answer.checks = error;
        return answer;
      }
      const v1::CheckConfigurationsResponse& checks = response.configurations();
      answer.checks = AnswerFrom(checks, *question.configurations, question.clearance,
                                 MadeAt(checks.basis(), question.asked, *clock_), address);
      return answer;
    }
    if (error.ok() && !response.has_path()) {
      return Malformed(address, "it is not the answer to a question about a path");
    }
    if (!error.ok()) {
      answer.path = error;
      return answer;
    }
    answer.path = AnswerFrom(response.path(), question.clearance,
                             MadeAt(response.path().basis(), question.asked, *clock_), address);
    return answer;
  }

  void End(const absl::Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (cancellation_.cancelled()) {
        ended_ = absl::CancelledError("the checks were cancelled");
      } else if (status.ok()) {
        ended_ = absl::OutOfRangeError("all questions are answered");
      } else {
        ended_ = status;
      }
    }
    changed_.notify_all();
  }

  const std::shared_ptr<const Connection> connection_;
  const absl::Duration timeout_;
  const std::string variant_;
  Cancellation cancellation_;
  grpc::ClientContext context_;
  std::optional<Cancellation::Call> call_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamChecksRequest, v1::StreamChecksResponse>>
      stream_;
  std::optional<ServerClock> clock_;  // the reader's own
  bool questions_ended_ = false;      // the sending thread's own

  std::mutex mutex_;
  std::condition_variable changed_;
  bool begun_ = false;  // there is a call, or will be at once
  std::deque<Question> unanswered_;
  std::deque<StreamedAnswer> answers_;  // that were not received
  size_t not_received_ = 0;             // questions, answered or not
  std::optional<absl::Status> ended_;
  std::jthread reader_;  // last: it uses the others
};

CheckStream::CheckStream(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
CheckStream::~CheckStream() = default;
CheckStream::CheckStream(CheckStream&&) noexcept = default;
CheckStream& CheckStream::operator=(CheckStream&&) noexcept = default;
void CheckStream::EndQuestions() { impl_->EndQuestions(); }
absl::StatusOr<StreamedAnswer> CheckStream::Receive() { return impl_->Receive(); }
void CheckStream::Cancel() { impl_->Cancel(); }

absl::Status CheckStream::Send(uint64_t id, std::span<const Configuration> configurations,
                               const Policy& policy, Evidence evidence, Clearance clearance) {
  v1::StreamChecksRequest question;
  question.set_id(id);
  *question.mutable_configurations() = QuestionOf(configurations, policy, evidence, clearance);
  return impl_->Send(std::move(question));
}

absl::Status CheckStream::SendPath(uint64_t id, std::span<const Configuration> waypoints,
                                   const Policy& policy, Clearance clearance,
                                   std::optional<double> resolution) {
  if (waypoints.empty()) return absl::InvalidArgumentError("a path has at least one waypoint");
  v1::StreamChecksRequest question;
  question.set_id(id);
  *question.mutable_path() = QuestionOf(waypoints, policy, clearance, resolution);
  return impl_->Send(std::move(question));
}

CheckStream Client::StreamChecks() const {
  return CheckStream(std::make_unique<CheckStream::Impl>(connection_, timeout_, variant_));
}

}  // namespace silhouette::client
