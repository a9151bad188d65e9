// SPDX-License-Identifier: Apache-2.0
// All scenes, and what clients that watch paths were answered: for recorders.
//
//   auto watch = client->WatchScenes();
//   while (true) {
//     const auto news = watch->Next(absl::Seconds(1));
//     if (absl::IsDeadlineExceeded(news.status())) continue;
//     if (!news.ok()) ...                            // lost: call WatchScenes again
//     if (news->has_scene()) ...
//   }
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace silhouette::v1 {
class WatchScenesResponse;
}  // namespace silhouette::v1

namespace silhouette::client {

// One call, read by a thread of its own. Any thread may call Cancel(); everything else is for one
// thread at a time.
class SceneWatch {
 public:
  // Ends the call; waits for no server.
  ~SceneWatch();
  SceneWatch(SceneWatch&&) noexcept;
  SceneWatch& operator=(SceneWatch&&) noexcept;

  // The next message, in order; all that arrived are returned before an error. DeadlineExceeded if
  // none comes within `timeout`: the watch continues. Cancelled after Cancel() only. Any other
  // error, as in Client: the watch is over; Unimplemented: the server is too old.
  absl::StatusOr<v1::WatchScenesResponse> Next(absl::Duration timeout);

  // Ends the call, and a Next() that waits.
  void Cancel();

 private:
  friend class Client;
  class Impl;
  explicit SceneWatch(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace silhouette::client
