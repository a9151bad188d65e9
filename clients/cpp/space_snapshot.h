// SPDX-License-Identifier: Apache-2.0
// Implementation of SpaceSnapshot.
#pragma once

#include <memory>
#include <optional>

#include "absl/time/time.h"
#include "clients/cpp/drawn_space.h"
#include "clients/cpp/off_grid.h"
#include "clients/cpp/space_map.h"
#include "silhouette/running_clock.h"
#include "silhouette/space_snapshot.h"

namespace silhouette::client {

// The end of a validity, and the reason afterwards.
struct Validity {
  RunningClock::time_point until = RunningClock::time_point::min();
  Reason then = Reason::kUpdateExpired;
};

// Of an update with this basis, if the scene may be `max_age` old.
Validity ValidityOf(const Basis& basis, absl::Duration max_age);

struct SpaceSnapshot::Content {
  Basis basis = {};
  std::shared_ptr<const SpaceMap> map = nullptr;
  // Decides any configuration; null: the map does.
  std::shared_ptr<const DrawnSpace> drawn = nullptr;
  std::optional<Reason> unknown = Reason::kNoUpdate;
  Validity validity = {};
  // Nothing: unknown; then only configurations on the grid have a state.
  std::optional<OffGridRule> rule = std::nullopt;
  uint64_t number = 0;
  uint64_t skipped_scenes = 0;
  uint64_t tiles_changed = 0;
};

}  // namespace silhouette::client
