// SPDX-License-Identifier: Apache-2.0
// A path, watched: a new verdict with every scene, and when a verdict expires.
//
//   auto watch = client->WatchPath(waypoints);
//   while (true) {
//     const auto update = watch->Next();
//     if (!update.ok()) ...                         // lost or cancelled: the path is not free
//     if (!update->FreeNow()) ...                   // stop the robot
//   }
#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "silhouette/answers.h"
#include "silhouette/running_clock.h"

namespace silhouette::client {

struct PathUpdate {
  // Valid until check.basis.valid_until if no update follows. What had expired when it was returned
  // is unknown, Reason::kUpdateExpired: the verdict if it was free, and the separation if it let
  // the robot move.
  PathCheck check;
  // Scenes since the update that Next() returned before, without an update of their own.
  uint64_t skipped_scenes = 0;
  // No new one: it was returned before, and some of it has expired since.
  bool repeated = false;

  // Whether the path is free and the update still valid.
  bool FreeNow() const;
};

// One call, read by a thread of its own: Next() returns the newest update and skips those in
// between. Any thread may call Cancel(); everything else is for one thread at a time.
class PathWatch {
 public:
  // Ends the call; waits for no server.
  ~PathWatch();
  PathWatch(PathWatch&&) noexcept;
  PathWatch& operator=(PathWatch&&) noexcept;

  // Waits for an update that was not returned yet, and returns the newest. If the last one's free
  // verdict or separation expires before, it returns that one again (`repeated`, unknown now): no
  // caller waits here through an expiry. DeadlineExceeded if nothing comes within `timeout`: the
  // watch continues. Cancelled after Cancel() only. Any other error, as in Client: the watch is
  // over, and every later Next() fails, too; Unimplemented also if the server does not report its
  // clock: then the age of a scene is unknown.
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
