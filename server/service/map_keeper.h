// SPDX-License-Identifier: Apache-2.0
// Works maps out before anybody asks.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <thread>

#include "server/scene/clock.h"
#include "server/scene/scene_store.h"
#include "server/service/serving_settings.h"
#include "server/service/space_cache.h"
#include "server/service/watch_hub.h"

namespace silhouette {

// As soon as there is a scene, its map under the default policy is worked out for
// ServingSettings::map_time, tile by tile, where that is a look into the index. The rest, and other
// policies, when they are asked for. Has a thread of its own.
class MapKeeper final : public Watcher {
 public:
  // All must outlive it.
  MapKeeper(const ServingSettings& settings, SceneStore& scenes, SpaceCache& spaces);

  // Whether there is anything to do.
  bool needed() const { return settings_.map_time > absl::ZeroDuration(); }

  void Tell(uint64_t version) override;
  void End() override;

 private:
  void Run(const std::stop_token& stop);
  void WorkOut(uint64_t version, const std::stop_token& stop);
  // Works out, for map_time, the tiles that are a look into the index. Whether no tile is left.
  bool WorkOutTiles(const ConfigurationSpace& space, uint64_t version,
                    const std::stop_token& stop) const;
  bool Outdated(uint64_t version) const;

  const ServingSettings& settings_;
  SceneStore& scenes_;
  SpaceCache& spaces_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  uint64_t told_ = 0;
  uint64_t noted_map_ = 0;  // the scene; used by the thread alone
  std::jthread thread_;     // last: it uses the others
};

}  // namespace silhouette
