// SPDX-License-Identifier: Apache-2.0
// Checks the collision index while it is served.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <random>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/scene/scene_store.h"
#include "server/service/serving_settings.h"
#include "server/service/space_cache.h"

namespace silhouette {

// The index of every variant lies in the database's file, where it can be damaged after it was
// loaded. This reads its tiles again and again, at most IndexCheckSettings::rate bytes a second,
// and compares the map of the newest scene with robot images. A mismatch is a DatabaseDamage: no
// verdict rests on the database any more. Has a thread of its own.
class IndexCheck {
 public:
  // What was found in order so far.
  struct Counts {
    uint64_t bytes = 0;     // of tiles
    uint64_t compared = 0;  // configurations
  };

  // All must outlive it.
  IndexCheck(const ServingSettings& settings, SceneStore& scenes, SpaceCache& spaces)
      : settings_(settings), scenes_(scenes), spaces_(spaces) {}

  // Begins to look, with every change of the scenes and at least every kPeriod. Once.
  void Start();

  // One look, as the thread has them; without Start() for one thread. `passed`: since the last one.
  void Look(absl::Duration passed);

  Counts counts() const { return {bytes_, compared_}; }

 private:
  static constexpr std::chrono::milliseconds kPeriod{50};

  struct Tile {
    const CollisionIndex* index;
    uint64_t tile;
  };

  void Run(const std::stop_token& stop);
  void Begin(const std::shared_ptr<const ServedDatabase>& database);
  // DataLoss: a tile has changed.
  absl::Status CheckTiles(absl::Duration passed);
  // DataLoss: the map of the newest scene of this database, under the default policy, is not that
  // of its masks, or knows a configuration whose masks can no longer be read.
  absl::Status CompareMap(const std::shared_ptr<const ServedDatabase>& whole);

  const ServingSettings& settings_;
  SceneStore& scenes_;
  SpaceCache& spaces_;
  std::weak_ptr<const ServedDatabase> database_;  // whose tiles these are
  std::vector<Tile> tiles_;
  size_t next_ = 0;    // of them
  double credit_ = 0;  // bytes that may be read
  std::mt19937_64 random_{std::random_device{}()};
  std::atomic<uint64_t> bytes_ = 0;
  std::atomic<uint64_t> compared_ = 0;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace silhouette
