// SPDX-License-Identifier: Apache-2.0
// A map of the configuration space as one scene makes it: what LocalSpace holds.
#pragma once

#include <chrono>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>

#include "absl/time/time.h"
#include "silhouette/answers.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/configuration_space.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// One scene, and until when its verdicts may be relied on: after that everything is unknown. A
// value that cannot be changed; any number of threads may read it.
class SpaceSnapshot : public std::enable_shared_from_this<SpaceSnapshot> {
 public:
  struct Content;
  explicit SpaceSnapshot(std::unique_ptr<const Content> content);
  ~SpaceSnapshot();
  SpaceSnapshot(const SpaceSnapshot&) = delete;
  SpaceSnapshot& operator=(const SpaceSnapshot&) = delete;

  // The scene, and how old it is: never less than it really is.
  const Basis& basis() const;
  absl::Duration Age() const { return basis().Age(); }

  // Why nothing is known of any configuration at this moment; nothing if verdicts may be relied on.
  std::optional<Reason> unknown_reason() const;

  // When that time ends, if it has not ended already.
  std::chrono::steady_clock::time_point usable_until() const;

  // Null until the first update has come.
  const ConfigurationGrid* grid() const;

  // Looks at the clock each time; unknown also for a number that no configuration of the grid has.
  State StateAt(ConfigurationNumber number) const;
  bool IsFree(ConfigurationNumber number) const { return StateAt(number) == State::kFree; }

  // The verdict on a configuration, on the grid or off it: what the server would say, or unknown
  // with the reason (off the grid the map may not be enough: kBetweenGridPoints; docs/concepts.md
  // tells where it is). Without evidence; names all allowed regions that touched the scene; whether
  // an obstacle may hide is not reported.
  Verdict Check(std::span<const double> q) const;
  Verdict Check(std::initializer_list<double> q) const {
    return Check(std::span(q.begin(), q.size()));
  }

  // Many at once, looking at the clock once.
  ConfigurationChecks CheckConfigurations(std::span<const Configuration> configurations) const;
  NumberChecks CheckNumbers(std::span<const uint32_t> numbers) const;

  // Over all configurations of the grid, at this moment; zeros without a grid.
  StateCounts Count() const;

  // Counts up with every update and every loss of the connection.
  uint64_t number() const;
  // Scenes between the update before and this one, which no update spoke of.
  uint64_t skipped_scenes() const;
  // Tiles that the update changed.
  uint64_t tiles_changed() const;

 private:
  // What the map says, whatever the time.
  Verdict InMap(std::span<const double> q) const;

  const std::unique_ptr<const Content> content_;
};

}  // namespace silhouette::client
