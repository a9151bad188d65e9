// StreamChecks: one call.
#pragma once

#include <grpcpp/support/server_callback.h>

#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "server/service/serving.h"
#include "server/service/watch_hub.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette {

// Reads a question only when the answer to the one before has been taken by the transport: a caller
// who does not read his answers holds back nobody. Keeps itself alive until the call is over.
class CheckStream final
    : public grpc::ServerBidiReactor<v1::StreamChecksRequest, v1::StreamChecksResponse>,
      public Watcher,
      public std::enable_shared_from_this<CheckStream> {
 public:
  CheckStream(Serving& serving, grpc::CallbackServerContext* context)
      : serving_(serving), context_(context) {}

  // Once, when the call comes.
  void Start();

  void Tell(uint64_t) override {}
  void End() override;

 private:
  // Whoever makes it kOver, from kReading or at the end of kAnswering, finishes the call.
  enum class Step { kReading, kAnswering, kOver };

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnDone() override;

  // The answer to the question that was read, into answer_.
  grpc::Status AnswerQuestion();
  // Sends what `answer` leaves in answer_, or its error.
  void Work(const std::function<grpc::Status()>& answer);

  Serving& serving_;
  grpc::CallbackServerContext* const context_;
  std::shared_ptr<CheckStream> self_;
  v1::StreamChecksRequest question_;
  v1::StreamChecksResponse answer_;
  std::mutex mutex_;
  Step step_ = Step::kReading;
  std::optional<grpc::Status> ending_;
};

}  // namespace silhouette
