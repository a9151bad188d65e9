// SPDX-License-Identifier: Apache-2.0
#include "server/service/watch_hub.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

namespace silhouette {

WatchedState::WatchedState(const Served& served, Reason the_reason, Reason of_calibration)
    : database(served.database),
      scene(served.scene == nullptr ? 0 : served.scene->id),
      regions(served.regions->revision),
      blocked(the_reason),
      calibration(of_calibration),
      trust(served.trust) {}

WatchHub::WatchHub(SceneStore& scenes, SceneSettings settings, Clock clock)
    : scenes_(scenes),
      settings_(settings),
      clock_(std::move(clock)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

void WatchHub::Add(const std::shared_ptr<Watcher>& watcher) {
  {
    const std::lock_guard lock(mutex_);
    if (!closed_) {
      watchers_.push_back(watcher);
      return;
    }
  }
  watcher->End();
}

void WatchHub::Close() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  for (const std::shared_ptr<Watcher>& watcher : Watchers()) watcher->End();
}

size_t WatchHub::watchers() const { return Watchers().size(); }

std::vector<std::shared_ptr<Watcher>> WatchHub::Watchers() const {
  const std::lock_guard lock(mutex_);
  std::erase_if(watchers_, [](const std::weak_ptr<Watcher>& watcher) { return watcher.expired(); });
  std::vector<std::shared_ptr<Watcher>> watchers;
  for (const std::weak_ptr<Watcher>& watcher : watchers_) {
    if (auto held = watcher.lock()) watchers.push_back(std::move(held));
  }
  return watchers;
}

void WatchHub::Run(const std::stop_token& stop) {
  uint64_t seen = 0;
  while (!stop.stop_requested()) {
    try {
      Look();
    } catch (const std::exception& error) {
      spdlog::error("internal error: {}", error.what());
    }
    seen = scenes_.WaitForChange(seen, kPeriod, stop);
  }
}

void WatchHub::Look() {
  const Moment now = clock_();
  for (const AllowedRegion& region : scenes_.TakeEnded(now)) {
    spdlog::info("allowed region '{}' has ended{}", region.name,
                 region.end > now.running ? " with its database" : "");
  }
  const Served served = scenes_.Newest(now);
  WatchedState state(served, BlockedReason(served, settings_, now), CalibrationReason(served, now));
  if (state != state_) {
    state_ = std::move(state);
    ++version_;
  }
  for (const std::shared_ptr<Watcher>& watcher : Watchers()) watcher->Tell(version_);
}

}  // namespace silhouette
