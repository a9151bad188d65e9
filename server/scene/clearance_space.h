// The configuration space in clearance levels: for one scene and one policy, which of the free
// configurations have more clearance (clearance.h) than each of some levels.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "db/index/place_set.h"
#include "server/collision/clearance.h"
#include "server/collision/collision_checker.h"
#include "server/collision/level_checker.h"
#include "server/collision/policy.h"
#include "server/scene/configuration_space.h"
#include "server/scene/scene_store.h"

namespace silhouette {

// Keeps database and scene alive. A tile is worked out when it is first asked for, by the collision
// index where the database has one, and never changes. Used by any number of threads.
class ClearanceSpace {
 public:
  // `verdicts`: the map of the same scene and policy, whose tiles are worked out with those here.
  // `levels`: in pixels of the masks; std::invalid_argument as RequireLevels has it.
  ClearanceSpace(std::shared_ptr<const ConfigurationSpace> verdicts, Served served,
                 const Policy& policy, std::vector<double> levels);

  const std::shared_ptr<const ConfigurationSpace>& verdicts() const { return verdicts_; }
  const std::vector<double>& levels() const { return levels_; }

  // Per level the configurations of the tile that are free and have more clearance.
  std::span<const PlaceSet> tile(uint64_t tile) const {
    if (!ready(tile)) WorkOut(tile);
    return tiles_[tile];
  }

  // Whether the tile has been worked out.
  bool ready(uint64_t tile) const { return ready_[tile].load(std::memory_order_acquire); }

  // What it takes when all tiles are worked out.
  uint64_t bytes() const { return tiles_.size() * levels_.size() * sizeof(PlaceSet); }

 private:
  const LevelChecker& Test() const;
  void WorkOut(uint64_t tile) const;

  std::shared_ptr<const ConfigurationSpace> verdicts_;
  Served served_;
  Policy policy_;
  std::vector<double> levels_;
  // What levels are told with, made with the first tile that has a free configuration.
  mutable std::once_flag prepare_;
  mutable std::optional<CollisionChecker> test_;
  mutable std::optional<ClearanceMeter> meter_;
  mutable std::optional<LevelChecker> level_checker_;
  mutable std::vector<std::vector<PlaceSet>> tiles_;
  std::unique_ptr<std::atomic<bool>[]> ready_;
  std::unique_ptr<std::once_flag[]> once_;
};

}  // namespace silhouette
