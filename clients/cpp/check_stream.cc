// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/check_stream.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "clients/cpp/check_answers.h"
#include "clients/cpp/messages.h"

namespace silhouette::client {
namespace {

using CheckStreamClock = std::chrono::steady_clock;

absl::Status NotAsked() { return absl::FailedPreconditionError("the question was another one"); }

}  // namespace

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
                                   const Policy& policy, Clearance clearance) {
  if (waypoints.empty()) return absl::InvalidArgumentError("a path has at least one waypoint");
  v1::StreamChecksRequest question;
  question.set_id(id);
  *question.mutable_path() = QuestionOf(waypoints, policy, clearance);
  return impl_->Send(std::move(question));
}

CheckStream::Impl::Impl(std::shared_ptr<const Connection> connection, std::string variant)
    : connection_(std::move(connection)), variant_(std::move(variant)) {
  call_.emplace(cancellation_, context_);
}

CheckStream::Impl::~Impl() {
  Cancel();
  if (reader_.joinable()) reader_.join();
  call_.reset();
}

void CheckStream::Impl::Cancel() {
  cancellation_.Cancel();
  {
    const std::lock_guard lock(mutex_);
    if (begun_ || ended_) return;  // the end of the call reports it
  }
  End(absl::CancelledError());
}

void CheckStream::Impl::Begin() {
  stream_ = connection_->collisions().StreamChecks(&context_);
  reader_ = std::jthread([this] { End(ReadAnswers()); });
}

absl::Status CheckStream::Impl::Send(v1::StreamChecksRequest question) {
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
      .asked = CheckStreamClock::now()};
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

void CheckStream::Impl::EndQuestions() {
  if (std::exchange(questions_ended_, true)) return;
  if (stream_ == nullptr) return End(absl::OkStatus());
  stream_->WritesDone();
}

absl::StatusOr<StreamedAnswer> CheckStream::Impl::Receive() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !answers_.empty() || ended_; });
  // After a loss or a cancellation no answer is returned.
  if (ended_ && ended_->code() != absl::StatusCode::kOutOfRange) return *ended_;
  if (answers_.empty()) return *ended_;
  StreamedAnswer answer = std::move(answers_.front());
  answers_.pop_front();
  --not_received_;
  return answer;
}

absl::Status CheckStream::Impl::ReadAnswers() {
  v1::StreamChecksResponse response;
  absl::Status fault;
  while (fault.ok() && stream_->Read(&response)) {
    Question question;
    {
      const std::lock_guard lock(mutex_);
      if (unanswered_.empty()) {
        fault = Malformed(connection_->address(), "it answers a question that was not asked");
        break;
      }
      question = unanswered_.front();
      unanswered_.pop_front();
    }
    absl::StatusOr<StreamedAnswer> answer = AnswerTo(question, response);
    fault = answer.status();
    if (!fault.ok()) break;
    {
      const std::lock_guard lock(mutex_);
      answers_.push_back(*std::move(answer));
    }
    changed_.notify_all();
  }
  if (!fault.ok()) context_.TryCancel();
  const grpc::Status finished = stream_->Finish();
  if (!fault.ok()) return fault;
  if (!finished.ok()) return connection_->SentenceFor(finished, absl::InfiniteDuration());
  const std::lock_guard lock(mutex_);
  if (unanswered_.empty()) return absl::OkStatus();
  return Malformed(connection_->address(),
                   absl::StrCat("it left ", unanswered_.size(), " questions unanswered"));
}

absl::StatusOr<StreamedAnswer> CheckStream::Impl::AnswerTo(
    const Question& question, const v1::StreamChecksResponse& response) const {
  const std::string& address = connection_->address();
  if (response.id() != question.id) {
    return Malformed(
        address, absl::StrCat("it answers question ", response.id(), " instead of ", question.id));
  }
  StreamedAnswer answer{.id = question.id, .checks = NotAsked(), .path = NotAsked()};
  absl::Status error;
  if (response.has_configurations() || response.has_path()) {
    error = RequireVariant(
        variant_, response.has_path() ? response.path().basis() : response.configurations().basis(),
        address);
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
    answer.checks = error.ok() ? AnswerFrom(response.configurations(), *question.configurations,
                                            question.clearance, question.asked, address)
                               : error;
    return answer;
  }
  if (error.ok() && !response.has_path()) {
    return Malformed(address, "it is not the answer to a question about a path");
  }
  answer.path =
      error.ok() ? AnswerFrom(response.path(), question.clearance, question.asked, address) : error;
  return answer;
}

void CheckStream::Impl::End(const absl::Status& status) {
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

}  // namespace silhouette::client
