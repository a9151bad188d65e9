// Tells in the log when allowed regions end.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "server/scene/clock.h"
#include "server/scene/scene_store.h"

namespace silhouette {

// Looks with a thread of its own, as long as regions are in force.
class RegionLog {
 public:
  // `scenes` must outlive it.
  RegionLog(SceneStore& scenes, Clock clock);

  // A region has been allowed.
  void Watch();

 private:
  // Ended regions are told at most so much later.
  static constexpr std::chrono::milliseconds kPeriod{100};

  void Run(const std::stop_token& stop);
  // Whether regions are still in force.
  bool TellEnded();

  SceneStore& scenes_;
  const Clock clock_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  bool watching_ = false;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace silhouette
