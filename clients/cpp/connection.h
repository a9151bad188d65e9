// The way to a server: its address, the channel, and what the errors of calls say.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette::client {

// InvalidArgument if no server can be at this address.
absl::Status RequireAddress(const std::string& address);

// The server sent what cannot be.
absl::Status Malformed(const std::string& address, absl::string_view what);

// A channel and its stubs; thread-safe as they are.
class Connection {
 public:
  explicit Connection(const std::string& address);

  const std::string& address() const { return address_; }
  v1::CollisionService::Stub& collisions() const { return *collisions_; }
  v1::SceneService::Stub& scenes() const { return *scenes_; }
  v1::DatabaseService::Stub& databases() const { return *databases_; }

  // How a call ended, in one sentence. `timeout`: what it was given.
  absl::Status SentenceFor(const grpc::Status& status, absl::Duration timeout) const;

  // One unary call; `context` may be cancelled from another thread.
  template <typename Stub, typename Request, typename Response>
  absl::Status Call(grpc::ClientContext& context, Stub& stub,
                    grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                    const Request& request, absl::Duration timeout, Response& response) const {
    context.set_deadline(absl::ToChronoTime(absl::Now() + timeout));
    return SentenceFor((stub.*method)(&context, request, &response), timeout);
  }
  template <typename Stub, typename Request, typename Response>
  absl::Status Call(Stub& stub,
                    grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                    const Request& request, absl::Duration timeout, Response& response) const {
    grpc::ClientContext context;
    return Call(context, stub, method, request, timeout, response);
  }

 private:
  const std::string address_;
  const std::shared_ptr<grpc::Channel> channel_;
  const std::unique_ptr<v1::CollisionService::Stub> collisions_;
  const std::unique_ptr<v1::SceneService::Stub> scenes_;
  const std::unique_ptr<v1::DatabaseService::Stub> databases_;
};

}  // namespace silhouette::client
