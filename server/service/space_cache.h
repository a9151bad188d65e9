// The configuration space of the newest scene, computed once for everybody who asks for it.
#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <vector>

#include "server/collision/collision_test.h"
#include "server/scene/scene_store.h"

namespace silhouette {

using ConfigurationSpace = std::vector<TileVerdicts>;  // by tile

class SpaceCache {
 public:
  // The verdicts of all tiles; blocks while they are computed, by this call or another one. Throws
  // as CheckAllTiles does. May be called from any thread.
  std::shared_ptr<const ConfigurationSpace> Get(const Served& served, const Policy& policy);

 private:
  struct Entry {
    SharedScene scene;
    Policy policy;
    std::mutex mutex;  // held while it is computed
    std::shared_ptr<const ConfigurationSpace> space;
  };
  static constexpr size_t kEntries = 4;

  std::shared_ptr<Entry> EntryFor(const SharedScene& scene, const Policy& policy);

  std::mutex mutex_;
  std::list<std::shared_ptr<Entry>> entries_;  // newest first
};

}  // namespace silhouette
