// SPDX-License-Identifier: Apache-2.0
// Notices when answers may have changed, and notifies the watchers.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "server/scene/checker.h"
#include "server/scene/clock.h"
#include "server/scene/scene_settings.h"
#include "server/scene/scene_store.h"

namespace silhouette {

// What answers rest on: equal states give equal answers.
struct WatchedState {
  WatchedState() = default;
  // `blocked`: BlockedReason (checker.h) of `served`; `calibration`: its CalibrationReason, where
  // `blocked` leaves it out.
  WatchedState(const Served& served, Reason blocked, Reason calibration = Reason::kNone);

  bool operator==(const WatchedState&) const = default;

  std::shared_ptr<const ServedDatabase> database;
  uint64_t scene = 0;  // its id; 0: none
  uint64_t regions = 0;
  Reason blocked = Reason::kNone;
  Reason calibration = Reason::kNone;
  std::shared_ptr<const CalibrationTrust> trust;
};

// Somebody who waits. Both functions are called by any thread, and return at once.
class Watcher {
 public:
  virtual ~Watcher() = default;

  // What answers rest on has changed for the `version`th time: now, or earlier, as it is
  // reported again and again.
  virtual void Tell(uint64_t version) = 0;

  // The server stops: no further call follows.
  virtual void End() = 0;
};

// What answers rest on changes with a scene, an allowed region that begins or ends, another
// database, a check of the calibration, and when the newest scene or check becomes too old. Looks
// with a thread of its own. Also logs when allowed regions end.
class WatchHub {
 public:
  // `scenes` must outlive it.
  WatchHub(SceneStore& scenes, SceneSettings settings, Clock clock);
  ~WatchHub() { Close(); }

  // From now on the watcher is notified. It is forgotten when its last other reference goes. After
  // Close() it is ended at once.
  void Add(const std::shared_ptr<Watcher>& watcher);

  // Ends all watchers.
  void Close();

  // How many watchers there are.
  size_t watchers() const;

 private:
  // What time alone changes is noticed at most so much later.
  static constexpr std::chrono::milliseconds kPeriod{20};

  void Run(const std::stop_token& stop);
  // Notices a change, and notifies all watchers.
  void Look();
  std::vector<std::shared_ptr<Watcher>> Watchers() const;

  SceneStore& scenes_;
  const SceneSettings settings_;
  const Clock clock_;
  WatchedState state_;    // as it was at the last look
  uint64_t version_ = 0;  // of state_; both are the thread's own
  mutable std::mutex mutex_;
  bool closed_ = false;
  mutable std::vector<std::weak_ptr<Watcher>> watchers_;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace silhouette
