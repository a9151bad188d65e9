// SPDX-License-Identifier: Apache-2.0
// What a PathWatch is made of.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "clients/cpp/connection.h"
#include "clients/cpp/server_clock.h"
#include "silhouette/path_watch.h"
#include "silhouette/policy.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette::client {

class PathWatch::Impl {
 public:
  // Begins at once.
  Impl(std::shared_ptr<const Connection> connection, absl::Duration timeout,
       v1::CheckPathRequest request, Clearance clearance);
  ~Impl() { Cancel(); }

  absl::StatusOr<PathUpdate> Next(absl::Duration timeout);
  void Cancel();

 private:
  // Runs the call to its end. Returns why it ended.
  absl::Status Run();
  // Stores an update. Returns an error if the call must end.
  absl::Status Take(const v1::WatchPathResponse& response, ServerClock& clock);

  const std::shared_ptr<const Connection> connection_;
  const absl::Duration timeout_;
  const v1::CheckPathRequest request_;
  const Clearance clearance_;
  Cancellation cancellation_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<PathUpdate> newest_;  // that was not returned yet
  uint64_t returned_scene_ = 0;
  std::optional<absl::Status> ended_;  // never OK
  std::jthread thread_;                // last: it uses the others
};

}  // namespace silhouette::client
