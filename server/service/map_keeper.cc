// SPDX-License-Identifier: Apache-2.0
#include "server/service/map_keeper.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <memory>

#include "server/scene/checker.h"

namespace silhouette {
namespace {

using SteadyClock = std::chrono::steady_clock;

}  // namespace

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
      if (!changed_.wait(lock, stop, [&] { return told_ != done; })) break;
      done = told_;
    }
    try {
      WorkOut(done, stop);
    } catch (const std::exception& error) {
      spdlog::error("internal error: {}", error.what());
    }
  }
}

void MapKeeper::WorkOut(uint64_t version, const std::stop_token& stop) {
  const Moment now = settings_.clock();
  const Served served = WithVariant(scenes_.Newest(now), /*name=*/"").value();
  const Policy policy = DefaultPolicy(settings_, *served.database);
  // Without an index, a map of drawn images is all drawing: it is worked out for those who ask.
  if (DrawsMaps(*served.database) ||
      BlockedReason(served, policy, settings_.scene, now) != Reason::kNone ||
      !served.database->CanServe(policy).ok()) {
    return;
  }
  if (!WorkOutTiles(*spaces_.Get(served, policy), version, stop)) return;
  if (noted_map_ == served.scene->id) return;
  noted_map_ = served.scene->id;
  if (settings_.live != nullptr) settings_.live->NoteMap(served.scene->arrived);
}

bool MapKeeper::WorkOutTiles(const ConfigurationSpace& space, uint64_t version,
                             const std::stop_token& stop) const {
  const SteadyClock::time_point end =
      SteadyClock::now() + absl::ToChronoNanoseconds(settings_.map_time);
  bool left = false;
  for (uint64_t tile = 0; tile < space.tiles(); ++tile) {
    if (space.ready(tile)) continue;
    if (SteadyClock::now() >= end || stop.stop_requested() || Outdated(version)) return false;
    if (space.looked_up(tile)) {
      space.tile(tile);
    } else {
      left = true;
    }
  }
  return !left;
}

}  // namespace silhouette
