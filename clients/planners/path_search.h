// SPDX-License-Identifier: Apache-2.0
// A path that is free everywhere, not only at the grid points.
//
// If more than one view must show an obstacle, a grid cell can be occupied although its corners are
// free: one view hits at one corner, another view at another. So the wave runs over the fetched
// configuration space, and the server checks the moves of the path. Moves that are not free are
// removed, and the wave runs again.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "absl/status/statusor.h"
#include "clients/planners/wave_propagation.h"
#include "silhouette/client.h"

namespace silhouette {

struct PathSearch {
  Plan plan;
  // Number of waves.
  int rounds = 0;
  // Moves between free grid points that the server found occupied.
  uint64_t blocked_moves = 0;
  // Set if a move became unknown, because the scene is no longer that of the space; there is no
  // path then.
  std::optional<client::Verdict> unknown = std::nullopt;
};

// `start_free`, `goal_free`: the server's verdicts for them. `stopped` is asked before each round;
// Aborted if it returns true.
absl::StatusOr<PathSearch> SearchPath(const Client& client, const client::Policy& policy,
                                      const client::ConfigurationSpace& space,
                                      const Configuration& start, bool start_free,
                                      const Configuration& goal, bool goal_free, Moves moves,
                                      const std::function<bool()>& stopped);

}  // namespace silhouette
