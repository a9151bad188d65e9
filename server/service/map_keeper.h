// Works maps out before anybody asks.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "absl/time/time.h"
#include "server/scene/clock.h"
#include "server/scene/scene_store.h"
#include "server/service/serving_settings.h"
#include "server/service/shared_map_writer.h"
#include "server/service/space_cache.h"
#include "server/service/watch_hub.h"

namespace silhouette {

// As soon as there is a scene, its map under the default policy is worked out for
// ServingSettings::map_time, tile by tile, where that is a look into the index. The rest, and other
// policies, when they are asked for. Has a thread of its own.
//
// A shared map gets every change as soon as that time is over, at the latest, and the tile
// that is being tested singly then: configurations that are not worked out are unknown in it. It
// gets the rest while nothing newer comes, for nobody else asks for it. The free cells of the grid
// come after the tiles, within the same times, where the policy looks at cells.
class MapKeeper final : public Watcher {
 public:
  // All must outlive it. `shared`: null if there is no shared map.
  MapKeeper(const ServingSettings& settings, SceneStore& scenes, SpaceCache& spaces,
            std::unique_ptr<SharedMapWriter> shared = nullptr);

  // Whether there is anything to do.
  bool needed() const { return needed_; }

  void Tell(uint64_t version) override;
  void End() override;

 private:
  void Run(const std::stop_token& stop);
  void WorkOut(uint64_t version, const std::stop_token& stop);
  // Works tiles out until `end`; those too that have to be tested singly, if `singly`. Whether none
  // is left.
  bool WorkOutTiles(const ConfigurationSpace& space, std::chrono::steady_clock::time_point end,
                    bool singly, const std::function<bool()>& stop) const;
  // The same with the free cells of all tiles.
  bool WorkOutCells(const ConfigurationSpace& space, std::chrono::steady_clock::time_point end,
                    const std::function<bool()>& stop) const;
  // The map of a scene is worked out, and shared if maps are.
  void NoteMap(const Scene& scene);
  // Publishes in the shared map, if there is one.
  void Share(const Served& served, const Policy& policy, const ConfigurationSpace* space,
             Reason blocked);
  bool Outdated(uint64_t version) const;

  const ServingSettings& settings_;
  SceneStore& scenes_;
  SpaceCache& spaces_;
  const bool needed_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  uint64_t told_ = 0;
  // Used by the thread alone.
  std::unique_ptr<SharedMapWriter> shared_;
  std::string share_fault_;
  uint64_t noted_map_ = 0;  // the scene
  std::jthread thread_;     // last: it uses the others
};

}  // namespace silhouette
