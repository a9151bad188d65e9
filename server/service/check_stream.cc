#include "server/service/check_stream.h"

#include "server/service/answers.h"

namespace silhouette {

void CheckStream::Start() {
  self_ = shared_from_this();
  StartRead(&question_);
  serving_.watches.Add(self_);
}

void CheckStream::End() {
  const grpc::Status status(grpc::StatusCode::UNAVAILABLE,
                            "the server stops; ask again when it is back");
  {
    const std::lock_guard lock(mutex_);
    if (step_ == Step::kAnswering) ending_ = status;
    if (step_ != Step::kReading) return;
    step_ = Step::kOver;
  }
  Finish(status);
}

void CheckStream::OnReadDone(bool ok) {
  {
    const std::lock_guard lock(mutex_);
    if (step_ == Step::kOver) return;
    step_ = ok ? Step::kAnswering : Step::kOver;
  }
  if (!ok) return Finish(grpc::Status::OK);  // the caller asks no more
  const bool at_once =
      question_.has_configurations() && AnsweredAtOnce(serving_, question_.configurations());
  if (at_once) return Work([this] { return AnswerQuestion(); });
  const auto work = [self = self_] { self->Work([&] { return self->AnswerQuestion(); }); };
  if (!serving_.workers.Run(work)) Work(TooBusy);
}

grpc::Status CheckStream::AnswerQuestion() {
  switch (question_.question_case()) {
    case v1::StreamChecksRequest::kConfigurations:
      return Answer(
          serving_, question_.configurations(), [this] { return context_->IsCancelled(); },
          answer_.mutable_configurations());
    case v1::StreamChecksRequest::kPath:
      return Answer(serving_, question_.path(), answer_.mutable_path());
    case v1::StreamChecksRequest::QUESTION_NOT_SET:
      break;
  }
  return {grpc::StatusCode::INVALID_ARGUMENT, "question: ask for configurations or for a path"};
}

void CheckStream::Work(const std::function<grpc::Status()>& answer) {
  answer_.Clear();
  answer_.set_id(question_.id());
  const grpc::Status status = Guarded(answer);
  if (!status.ok()) {
    answer_.mutable_error()->set_code(status.error_code());
    answer_.mutable_error()->set_message(status.error_message());
  }
  StartWrite(&answer_);
}

void CheckStream::OnWriteDone(bool ok) {
  std::unique_lock lock(mutex_);
  if (ok && !ending_) {
    step_ = Step::kReading;
    StartRead(&question_);
    return;
  }
  step_ = Step::kOver;
  lock.unlock();
  Finish(ok ? *ending_ : grpc::Status::CANCELLED);  // not ok: nobody listens any more
}

void CheckStream::OnDone() {
  const std::shared_ptr<Watcher> last = std::move(self_);  // perhaps a worker still holds it
}

}  // namespace silhouette
