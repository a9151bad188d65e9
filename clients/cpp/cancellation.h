// Ends the calls of one object from any thread.
#pragma once

#include <grpcpp/client_context.h>

#include <mutex>
#include <set>

namespace silhouette::client {

class Cancellation {
 public:
  // From now on, calls are cancelled: those under way and those that begin.
  void Cancel() {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
    for (grpc::ClientContext* call : calls_) call->TryCancel();
  }

  bool cancelled() const {
    const std::lock_guard lock(mutex_);
    return cancelled_;
  }

  // Lives as long as the call of this context may be under way, and not longer than the context.
  class Call {
   public:
    Call(Cancellation& cancellation, grpc::ClientContext& context)
        : cancellation_(cancellation), context_(context) {
      const std::lock_guard lock(cancellation_.mutex_);
      cancellation_.calls_.insert(&context_);
      if (cancellation_.cancelled_) context_.TryCancel();
    }
    ~Call() {
      const std::lock_guard lock(cancellation_.mutex_);
      cancellation_.calls_.erase(&context_);
    }
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;

   private:
    Cancellation& cancellation_;
    grpc::ClientContext& context_;
  };

 private:
  mutable std::mutex mutex_;
  bool cancelled_ = false;
  std::set<grpc::ClientContext*> calls_;
};

}  // namespace silhouette::client
