#include "server/service/map_keeper.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "server/scene/checker.h"

namespace silhouette {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr absl::Duration kLeastShareTime = absl::Milliseconds(20);

SteadyClock::time_point EndOf(absl::Duration time) {
  return SteadyClock::now() + absl::ToChronoNanoseconds(time);
}

}  // namespace

MapKeeper::MapKeeper(const ServingSettings& settings, SceneStore& scenes, SpaceCache& spaces,
                     std::unique_ptr<SharedMapWriter> shared)
    : settings_(settings),
      scenes_(scenes),
      spaces_(spaces),
      needed_(shared != nullptr || settings.map_time > absl::ZeroDuration()),
      shared_(std::move(shared)),
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
  shared_.reset();  // no update will follow
}

void MapKeeper::WorkOut(uint64_t version, const std::stop_token& stop) {
  const Moment now = settings_.clock();
  const absl::StatusOr<Served> found = WithVariant(scenes_.Newest(now), /*name=*/"");
  if (!found.ok()) throw std::runtime_error(std::string(found.status().message()));
  const Served& served = *found;
  const Policy policy = DefaultPolicy(settings_, *served.database);
  Reason blocked = BlockedReason(served, policy, settings_.scene, now);
  if (blocked == Reason::kNone && !served.database->CanServe(policy).ok()) {
    blocked = Reason::kInternal;
  }
  if (blocked != Reason::kNone) return Share(served, policy, nullptr, blocked);
  const auto outdated = [&] { return stop.stop_requested() || Outdated(version); };
  std::shared_ptr<const ConfigurationSpace> space;
  try {
    space = spaces_.Get(served, policy);
    absl::Duration time = settings_.map_time;
    if (shared_ == nullptr) {
      if (WorkOutTiles(*space, EndOf(time), /*singly=*/false, outdated)) NoteMap(*served.scene);
      return;
    }
    const bool cells = policy.off_grid == OffGrid::kCell;
    const auto work_out = [&](const std::function<bool()>& until) {
      const SteadyClock::time_point end = EndOf(time);
      return WorkOutTiles(*space, end, /*singly=*/true, until) &&
             (!cells || WorkOutCells(*space, end, until));
    };
    // The first time to the end: else scenes that come fast would keep the map from being shared.
    time = std::max(time, kLeastShareTime);
    bool whole = work_out([] { return false; });
    // What has been withdrawn meanwhile is not published: the next change is known already.
    const auto withdrawn = [&] {
      return scenes_.database() != served.whole || scenes_.trust() != served.trust ||
             scenes_.Revoked(*served.regions) || scenes_.Withdrawn(*served.scene);
    };
    if (withdrawn()) return;
    Share(served, policy, space.get(), blocked);
    if (whole) NoteMap(*served.scene);
    while (!whole && !outdated()) {
      time *= 2;
      whole = work_out(outdated);
      if (withdrawn()) return;
      Share(served, policy, space.get(), blocked);
      if (whole) NoteMap(*served.scene);
    }
  } catch (const std::exception&) {
    Share(served, policy, nullptr, Reason::kInternal);
    throw;
  }
}

bool MapKeeper::WorkOutTiles(const ConfigurationSpace& space, SteadyClock::time_point end,
                             bool singly, const std::function<bool()>& stop) const {
  bool left = false;
  for (const bool now_singly : {false, true}) {
    if (now_singly && (!left || !singly)) break;
    for (uint64_t tile = 0; tile < space.tiles(); ++tile) {
      if (space.ready(tile)) continue;
      if (SteadyClock::now() >= end || stop()) return false;
      if (now_singly || space.looked_up(tile)) {
        space.tile(tile);
      } else {
        left = true;
      }
    }
  }
  return singly || !left;
}

bool MapKeeper::WorkOutCells(const ConfigurationSpace& space, SteadyClock::time_point end,
                             const std::function<bool()>& stop) const {
  std::vector<uint64_t> tiles(space.tiles());
  std::iota(tiles.begin(), tiles.end(), uint64_t{0});
  return space.WorkOutCells(tiles, [&] { return SteadyClock::now() >= end || stop(); });
}

void MapKeeper::NoteMap(const Scene& scene) {
  if (noted_map_ == scene.id) return;
  noted_map_ = scene.id;
  if (settings_.live != nullptr) settings_.live->NoteMap(scene.arrived);
}

void MapKeeper::Share(const Served& served, const Policy& policy, const ConfigurationSpace* space,
                      Reason blocked) {
  if (shared_ == nullptr) return;
  const absl::Status status = shared_->Publish(served, policy, space, blocked);
  std::string fault(status.message());
  if (fault != share_fault_ && !status.ok()) spdlog::error("{}; it is closed", fault);
  share_fault_ = std::move(fault);
}

}  // namespace silhouette
