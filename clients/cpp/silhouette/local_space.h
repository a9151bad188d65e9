// SPDX-License-Identifier: Apache-2.0
// The configuration space, kept up to date in the client: checks take nanoseconds and no call. Of a
// robot whose images are drawn it holds the scene's obstacles instead, and checks any configuration
// and any straight motion in microseconds.
//
//   silhouette::LocalSpace space(*client, {.max_age = absl::Milliseconds(300)});
//   ...
//   if (space.Check(q).free()) ...
//
// For many checks take a snapshot: all its verdicts are from one scene.
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
  // Greatest age of a usable scene, positive. The server's own max_age also applies if it is
  // smaller; infinite: that alone.
  absl::Duration max_age = absl::Seconds(1);
  // If robot images are drawn: hold the scene's obstacles, which decide any configuration; the map
  // only of `tiles`, or if the server has a collision index. Under the presets uncalibrated and
  // paper; under any other everything is unknown, kNotCheckedHere, and LocalSpaceStatus::problem
  // says so. False: hold the map, as of a robot whose images are captured.
  bool obstacles = true;
};

// State of the subscription.
struct LocalSpaceStatus {
  // Updates come, or may come at any time.
  bool connected = false;
  // Why it is not connected; it keeps trying.
  absl::Status problem = absl::OkStatus();
  // Number of attempts to connect.
  uint64_t attempts = 0;
  uint64_t updates = 0;
  // Scenes without an update of their own, because they came faster than updates could be sent.
  uint64_t skipped_scenes = 0;
};

// Subscribes at construction, with a thread of its own, until destruction. Verdicts are those of
// the server. Everything is unknown, with the reason, before the first update, while the stream is
// lost, if the server's data are unusable, if the scene is older than max_age or has expired
// (detected without the server), while its age is unknown, and if the server reports unknown.
//
// The age of a scene follows from the server's running clock, which is requested once a second. So
// a message that was delayed counts with its real age. Time that a computer sleeps counts, too.
//
// Any number of threads may use it at once; reading never waits for an update. Threads that check
// often should use snapshots, because single checks share a counter.
class LocalSpace {
 public:
  // Returns at once. Throws std::invalid_argument if max_age is not positive. It uses the client's
  // variant (Client::WithVariant); without one, the variant of the newest scene.
  explicit LocalSpace(const Client& client, LocalSpaceOptions options = {});
  // Ends the subscription; waits for no server.
  ~LocalSpace();
  LocalSpace(const LocalSpace&) = delete;
  LocalSpace& operator=(const LocalSpace&) = delete;

  // As in SpaceSnapshot, of the newest snapshot. `basis`: if not null, receives the basis of the
  // verdict.
  State StateAt(ConfigurationNumber number) const;
  bool IsFree(ConfigurationNumber number) const { return StateAt(number) == State::kFree; }
  Verdict Check(std::span<const double> q, Basis* basis = nullptr) const;
  Verdict Check(std::initializer_list<double> q, Basis* basis = nullptr) const {
    return Check(std::span(q.begin(), q.size()), basis);
  }
  MotionVerdict CheckMotion(std::span<const double> from, std::span<const double> to,
                            double path_resolution = 0.005) const {
    return Snapshot()->CheckMotion(from, to, path_resolution);
  }
  // The same; where what is held here does not decide it, the server does, by its newest scene. If
  // it does not answer, unknown, kConnectionLost; if it refuses, kRefused: Client::CheckPath of
  // the same motion says why.
  MotionVerdict CheckMotionOrAsk(std::span<const double> from, std::span<const double> to,
                                 double path_resolution = 0.005) const;
  ConfigurationChecks CheckConfigurations(std::span<const Configuration> configurations) const {
    return Snapshot()->CheckConfigurations(configurations);
  }
  NumberChecks CheckNumbers(std::span<const uint32_t> numbers) const {
    return Snapshot()->CheckNumbers(numbers);
  }
  Basis basis() const { return Snapshot()->basis(); }
  absl::Duration Age() const { return Snapshot()->Age(); }
  std::optional<Reason> unknown_reason() const { return Snapshot()->unknown_reason(); }

  // The newest snapshot, never null. It does not change when newer ones come or the stream is lost;
  // it is valid until its usable_until().
  std::shared_ptr<const SpaceSnapshot> Snapshot() const;

  // Waits for a snapshot whose number() is above `after`, at most for `timeout`, and returns the
  // newest in any case. (Not scene numbers: a restarted server counts its scenes from 1 again.)
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
