// SPDX-License-Identifier: Apache-2.0
// The configuration space, kept up to date in the client: checks take nanoseconds and no call.
//
//   silhouette::LocalSpace space(*client, {.max_age = absl::Milliseconds(300)});
//   ...
//   if (space.Check(q).free()) ...
//
// A planner that checks much takes a snapshot, so that all its checks speak of one scene:
//
//   const auto snapshot = space.Snapshot();
//   while (planning) ... snapshot->StateAt(number) ...
//   const auto next = space.WaitForUpdate(snapshot->number(), absl::Seconds(1));   // plan again
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "silhouette/client.h"
#include "silhouette/policy.h"
#include "silhouette/space_snapshot.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

struct LocalSpaceOptions {
  Policy policy = {};
  // Only these tiles of the grid; everything else is unknown. Empty: all.
  std::vector<uint64_t> tiles = {};
  // The greatest age of a scene whose verdicts count, positive. What the server is set to counts,
  // too, if it is less.
  absl::Duration max_age = absl::Seconds(1);
};

// How the subscription stands.
struct LocalSpaceStatus {
  // Updates come, or may come at any time.
  bool connected = false;
  // Why it is not connected: it tries again all the time.
  absl::Status problem = absl::OkStatus();
  // How often it has tried to connect.
  uint64_t attempts = 0;
  uint64_t updates = 0;
  // Scenes that no update spoke of, because they came faster than they could be sent.
  uint64_t skipped_scenes = 0;
};

// Subscribes when it is made, with a thread of its own, until it goes. Everything is unknown, each
// with its reason, before the first update; when the stream is lost, and until it is there again;
// when what the server sent cannot be used; when the scene is older than max_age, or the server no
// longer vouches for it, which is noticed without the server; while the age of the scene is
// unknown; and when the server says so. Without a reason to doubt them, verdicts are those that
// the server gives.
//
// How old a scene is follows from the server's running clock, which is asked once a second: a
// message that waited on its way is as old as it is. (Time that the computer slept does not count
// until the clock was asked again.)
//
// Any number of threads may use it at once; reading never waits for an update. Threads that check
// in turns share a counter; those that check much are better off with snapshots.
class LocalSpace {
 public:
  // Returns at once. Throws std::invalid_argument if max_age is not positive. With the variant of
  // the client (Client::WithVariant); if it has none, of whatever variant the newest scene is.
  explicit LocalSpace(const Client& client, LocalSpaceOptions options = {});
  // Ends the subscription; waits for no server.
  ~LocalSpace();
  LocalSpace(const LocalSpace&) = delete;
  LocalSpace& operator=(const LocalSpace&) = delete;

  // As SpaceSnapshot has them, of the newest snapshot. `basis`: if not null, gets what the verdict
  // rests on.
  State StateAt(ConfigurationNumber number) const;
  bool IsFree(ConfigurationNumber number) const { return StateAt(number) == State::kFree; }
  Verdict Check(std::span<const double> q, Basis* basis = nullptr) const;
  Verdict Check(std::initializer_list<double> q, Basis* basis = nullptr) const {
    return Check(std::span(q.begin(), q.size()), basis);
  }
  ConfigurationChecks CheckConfigurations(std::span<const Configuration> configurations) const {
    return Snapshot()->CheckConfigurations(configurations);
  }
  NumberChecks CheckNumbers(std::span<const uint32_t> numbers) const {
    return Snapshot()->CheckNumbers(numbers);
  }
  Basis basis() const { return Snapshot()->basis(); }
  absl::Duration Age() const { return Snapshot()->Age(); }
  std::optional<Reason> unknown_reason() const { return Snapshot()->unknown_reason(); }

  // The newest. Never null; goes on being what it is when newer ones come or the stream is lost, so
  // that it may be relied on until its usable_until().
  std::shared_ptr<const SpaceSnapshot> Snapshot() const;

  // Waits for a snapshot whose number() is above `after`, at most for `timeout`, and returns the
  // newest in any case. (Numbers and not scenes: a restarted server counts its scenes from 1
  // again.)
  std::shared_ptr<const SpaceSnapshot> WaitForUpdate(uint64_t after, absl::Duration timeout) const;

  LocalSpaceStatus status() const;

 private:
  class Impl;
  const std::unique_ptr<Impl> impl_;
};

}  // namespace silhouette::client

namespace silhouette {
using LocalSpace = client::LocalSpace;
}  // namespace silhouette
