// SPDX-License-Identifier: Apache-2.0
// The configuration-space maps of the newest scene, one per policy and variant, shared
// by everybody who asks.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <vector>

#include "server/collision/policy.h"
#include "server/scene/configuration_space.h"
#include "server/scene/made_once.h"
#include "server/scene/scene_store.h"

namespace silhouette {

class SpaceCache {
 public:
  // The map of the scene under the policy. The first call prepares the test, others wait for it;
  // tiles are worked out when they are asked for. Throws as ConfigurationSpace does. May be called
  // from any thread. The maps of the few policies and variants that were asked for last are kept,
  // and only those of one scene.
  std::shared_ptr<const ConfigurationSpace> Get(const Served& served, const Policy& policy);

  // The same if somebody has asked for it already; else null.
  std::shared_ptr<const ConfigurationSpace> Find(const Served& served, const Policy& policy);

 private:
  struct Entry {
    SharedScene scene;
    std::shared_ptr<const ServedDatabase> database;
    Policy policy;
    MadeOnce<std::shared_ptr<const ConfigurationSpace>> space;
  };
  static constexpr size_t kEntries = 4;

  std::shared_ptr<Entry> EntryFor(const Served& served, const Policy& policy);

  std::mutex mutex_;
  std::list<std::shared_ptr<Entry>> entries_;  // newest first
};

// The configuration space of the newest scene in clearance levels, shared by everybody who asks for
// the same levels under the same policy.
class ClearanceCache {
 public:
  // `bytes`: what all that is kept may take at most.
  explicit ClearanceCache(uint64_t bytes = uint64_t{256} << 20) : bytes_(bytes) {}

  // `verdicts`: the map of the scene under the policy; tiles are worked out when they are asked
  // for. Throws as ClearanceSpace does. May be called from any thread. Those that were asked for
  // last are kept, a few, as far as memory allows, the last one in any case, and only those of one
  // scene.
  std::shared_ptr<const ClearanceSpace> Get(
      const Served& served, const Policy& policy,
      const std::shared_ptr<const ConfigurationSpace>& verdicts, const std::vector<double>& levels);

 private:
  struct Entry {
    SharedScene scene;
    std::shared_ptr<const ClearanceSpace> space;
  };

  static constexpr size_t kEntries = 16;

  const uint64_t bytes_;
  std::mutex mutex_;
  std::list<Entry> entries_;  // newest first
};

}  // namespace silhouette
