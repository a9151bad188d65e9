// SPDX-License-Identifier: Apache-2.0
// The connection to a server: address, channel, and the error messages of calls.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/security/credentials.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <type_traits>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette::client {

// "200 ms", "3 s".
std::string SpokenTimeout(absl::Duration timeout);

// InvalidArgument if no server can be at this address.
absl::Status RequireAddress(const std::string& address);

// The server's answer is malformed.
absl::Status Malformed(const std::string& address, absl::string_view what);

// FailedPrecondition in a process that was forked from one that had a connection: it has copies of
// its sockets, and none of gRPC's threads. What it wrote would mix with its parent's questions, and
// answers would reach the wrong one.
absl::Status RequireNotForked();

// Before a call: RequireNotForked, and InvalidArgument if its timeout is not positive.
absl::Status RequireCallable(absl::Duration timeout);

// Ends the calls of one object from any thread.
class Cancellation {
 public:
  // Cancels all running and future calls.
  void Cancel() {
    if (!RequireNotForked().ok()) return;  // the parent's
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
    for (grpc::ClientContext* call : calls_) call->TryCancel();
  }

  bool cancelled() const {
    const std::lock_guard lock(mutex_);
    return cancelled_;
  }

  // Lives while the call of this context may run, and not longer than the context.
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

// A channel and its stubs; thread-safe like them.
class Connection {
 public:
  // `encrypted`: whether the credentials are of TLS.
  Connection(const std::string& address,
             const std::shared_ptr<grpc::ChannelCredentials>& credentials, bool encrypted);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  const std::string& address() const { return address_; }
  // For streams: only where RequireCallable() is OK. As a call does, they give a failed connection
  // a moment.
  v1::CollisionService::Stub& collisions() const {
    Reconnect(absl::InfiniteFuture());
    return *collisions_;
  }
  v1::SceneService::Stub& scenes() const {
    Reconnect(absl::InfiniteFuture());
    return *scenes_;
  }
  // Before a stream that ended is begun again: waits, and if the connection was lost, not longer
  // than until it is there again. `stop` ends it within an instant.
  void Pause(absl::Duration pause, const std::stop_token& stop) const;

  // FailedPrecondition if an answer is not of the same cell as the first one of this connection
  // was: it says nothing about the configurations of the caller. `Answer`: a v1::Basis or a
  // v1::GetDatabaseResponse.
  template <typename Answer>
  absl::Status RequireSameCell(const Answer& answer) const {
    return RequireSameCell({.name = answer.cell_name(), .digest = answer.cell_digest()});
  }

  // The end of a call, in one sentence; never Cancelled. `timeout`: the call's; infinite: it has no
  // deadline, and never ends as DeadlineExceeded either.
  absl::Status SentenceFor(const grpc::Status& status, absl::Duration timeout) const;

  // One unary call; `context` may be cancelled from another thread.
  template <typename Stub, typename Request, typename Response>
  absl::StatusOr<Response> Call(grpc::ClientContext& context,
                                grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                             Response*),
                                const Request& request, absl::Duration timeout) const {
    if (absl::Status usable = RequireCallable(timeout); !usable.ok()) return usable;
    const absl::Time deadline = absl::Now() + timeout;
    Reconnect(deadline);
    context.set_deadline(absl::ToChronoTime(deadline));
    Response response;
    const absl::Status status =
        SentenceFor((StubOf<Stub>().*method)(&context, request, &response), timeout);
    if (!status.ok()) return status;
    return response;
  }
  template <typename Stub, typename Request, typename Response>
  absl::StatusOr<Response> Call(grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                             Response*),
                                const Request& request, absl::Duration timeout) const {
    grpc::ClientContext context;
    return Call(context, method, request, timeout);
  }

  // Reads the stream of `context` to its end; an error of `take(message)` ends it. Returns this
  // error, or how the server ended the call. `timeout`: as of SentenceFor.
  template <typename Message, typename Stream, typename Take>
  absl::Status ReadAll(Stream& stream, grpc::ClientContext& context, absl::Duration timeout,
                       const Take& take) const {
    absl::Status fault;
    for (Message message; fault.ok() && stream.Read(&message);) fault = take(message);
    if (!fault.ok()) context.TryCancel();
    const grpc::Status finished = stream.Finish();
    return fault.ok() ? SentenceFor(finished, timeout) : fault;
  }

 private:
  // Of a server that does not state it: none.
  struct Cell {
    std::string name;
    uint64_t digest = 0;
  };
  absl::Status RequireSameCell(const Cell& cell) const;
  // Where the last attempt to connect failed: gives the next one a moment.
  void Reconnect(absl::Time deadline) const;
  template <typename Stub>
  Stub& StubOf() const {
    if constexpr (std::is_same_v<Stub, v1::CollisionService::Stub>) {
      return *collisions_;
    } else if constexpr (std::is_same_v<Stub, v1::SceneService::Stub>) {
      return *scenes_;
    } else {
      return *databases_;
    }
  }

  const std::string address_;
  const bool encrypted_;
  const std::shared_ptr<grpc::Channel> channel_;
  const std::unique_ptr<v1::CollisionService::Stub> collisions_;
  const std::unique_ptr<v1::SceneService::Stub> scenes_;
  const std::unique_ptr<v1::DatabaseService::Stub> databases_;
  mutable std::mutex mutex_;
  mutable std::optional<Cell> cell_;  // of the first answer
};

}  // namespace silhouette::client
