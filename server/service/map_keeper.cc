#include "server/service/map_keeper.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <memory>

#include "server/scene/checker.h"

namespace silhouette {

MapKeeper::MapKeeper(const ServingSettings& settings, SceneStore& scenes, SpaceCache& spaces)
    : settings_(settings),
      scenes_(scenes),
      spaces_(spaces),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

void MapKeeper::Tell(uint64_t version) {
  {
    const std::lock_guard lock(mutex_);
    if (told_ >= version) return;
    told_ = version;
  }
  changed_.notify_one();
}

void MapKeeper::End() { thread_.request_stop(); }

bool MapKeeper::Outdated(uint64_t version) const {
  const std::lock_guard lock(mutex_);
  return told_ != version;
}

void MapKeeper::Run(const std::stop_token& stop) {
  uint64_t done = 0;
  while (!stop.stop_requested()) {
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [&] { return told_ != done; })) return;
      done = told_;
    }
    try {
      WorkOut(done);
    } catch (const std::exception& error) {
      spdlog::error("internal error: {}", error.what());
    }
  }
}

void MapKeeper::WorkOut(uint64_t version) {
  using SteadyClock = std::chrono::steady_clock;
  const auto end = SteadyClock::now() + absl::ToChronoNanoseconds(settings_.map_time);
  const Moment now = settings_.clock();
  const Served served = scenes_.Newest(now);
  if (BlockedReason(served, settings_.scene, now) != Reason::kNone) return;
  const Policy policy = DefaultPolicy(settings_, *served.database);
  if (!served.database->CanServe(policy).ok()) return;
  const std::shared_ptr<const ConfigurationSpace> space = spaces_.Get(served, policy);
  for (uint64_t tile = 0; tile < space->tiles(); ++tile) {
    if (SteadyClock::now() >= end || Outdated(version)) return;
    if (space->looked_up(tile)) space->tile(tile);
  }
}

}  // namespace silhouette
