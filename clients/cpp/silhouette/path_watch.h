// SPDX-License-Identifier: Apache-2.0
// A path, watched: a new verdict with every scene.
//
//   auto watch = client->WatchPath(waypoints);
//   while (true) {
//     const auto update = watch->Next();
//     if (!update.ok()) ...                         // lost or cancelled: the path is not free
//     if (!update->FreeNow()) ...                   // stop the robot
//   }
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "silhouette/answers.h"

namespace silhouette::client {

struct PathUpdate {
  PathCheck check;
  // Until when it may be relied on, if none follows: then the scene is too old for the server, or
  // an allowed region ends.
  std::chrono::steady_clock::time_point valid_until;
  // Scenes between the update that Next() returned before and this one, which it did not return.
  uint64_t skipped_scenes = 0;

  // Whether the path is free and this may still be relied on.
  bool FreeNow() const;
};

// One call. Reads with a thread of its own, so that who calls Next() seldom gets the newest update
// and not those in between. Cancel() may be called by any thread, everything else by one at a time.
class PathWatch {
 public:
  // Ends the call; waits for no server.
  ~PathWatch();
  PathWatch(PathWatch&&) noexcept;
  PathWatch& operator=(PathWatch&&) noexcept;

  // The newest update, as soon as there is one that was not returned yet. DeadlineExceeded if none
  // comes within `timeout`: the watch goes on. Cancelled after Cancel(). Everything else, as Client
  // has it, says that the watch is over, every time from then on; Unimplemented also if the server
  // does not report its clock: then the age of a scene is unknown.
  absl::StatusOr<PathUpdate> Next(absl::Duration timeout = absl::InfiniteDuration());

  // Ends the call, and a Next() that waits.
  void Cancel();

 private:
  friend class Client;
  class Impl;
  explicit PathWatch(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace silhouette::client
