#include "server/service/region_log.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

namespace silhouette {

RegionLog::RegionLog(SceneStore& scenes, Clock clock)
    : scenes_(scenes),
      clock_(std::move(clock)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

void RegionLog::Watch() {
  {
    const std::lock_guard lock(mutex_);
    watching_ = true;
  }
  changed_.notify_one();
}

void RegionLog::Run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return watching_; }) && !stop.stop_requested()) {
    changed_.wait_for(lock, stop, kPeriod, [] { return false; });
    try {
      watching_ = TellEnded();
    } catch (const std::exception& error) {
      spdlog::error("internal error: {}", error.what());
    }
  }
}

bool RegionLog::TellEnded() {
  const Moment now = clock_();
  for (const AllowedRegion& region : scenes_.TakeEnded(now)) {
    spdlog::info("allowed region '{}' has ended{}", region.name,
                 region.end > now.running ? " with its database" : "");
  }
  return !scenes_.Newest(now).regions->regions.empty();
}

}  // namespace silhouette
