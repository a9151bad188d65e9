// SPDX-License-Identifier: Apache-2.0
// A server in this process, with a scene that does not grow old.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "server/service/server.h"
#include "silhouette/v1/scene_service.grpc.pb.h"
#include "tests/benchmark/scenes.h"
#include "tests/benchmark/synthetic_cell.h"

namespace silhouette::benchmarks {

// Throws std::runtime_error with `what` if not `ok`.
void Require(bool ok, const std::string& what);

class RunningServer {
 public:
  // Serves `database`, which is of `cell`, at `address` and publishes a scene with a person. Throws
  // std::runtime_error if that is not possible.
  RunningServer(const std::string& address, const SyntheticCell& cell,
                std::shared_ptr<const ServedDatabase> database);

  const std::string& address() const { return server_->address(); }
  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }

  // A scene of `cell`, taken now.
  static v1::PublishSceneRequest RequestOf(const SyntheticCell& cell, const BenchmarkScene& scene);
  // Throws std::runtime_error if it is refused.
  void Publish(const v1::PublishSceneRequest& request);

 private:
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
};

}  // namespace silhouette::benchmarks
