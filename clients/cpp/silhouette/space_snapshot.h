// A map of the configuration space as one scene makes it: what LocalSpace holds.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

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

  // Why nothing is known of any configuration at this moment; nothing if verdicts may be relied on.
  std::optional<Reason> unknown() const;

  // When that time ends, if it has not ended already.
  std::chrono::steady_clock::time_point usable_until() const;

  // Null until the first update has come.
  const ConfigurationGrid* grid() const;

  // Looks at the clock each time; unknown also for a number that no configuration of the grid has.
  State StateAt(ConfigurationNumber number) const;
  bool IsFree(ConfigurationNumber number) const { return StateAt(number) == State::kFree; }

  // The states of many at once, looking at the clock once: `states` has the length of `numbers`.
  void StatesAt(std::span<const ConfigurationNumber> numbers, std::span<State> states) const;

  // The verdict on a configuration, on the grid or off it: what the server would say, or unknown
  // with the reason. Without evidence; names all allowed regions that touched the scene; whether an
  // obstacle may hide is not told.
  Verdict Check(std::span<const double> configuration) const;

  // Over all configurations of the grid, at this moment; zeros without a grid.
  StateCounts Count() const;

  // Counts up with every update and every loss of the connection.
  uint64_t number() const;
  // Scenes between the update before and this one, which no update spoke of.
  uint64_t skipped_scenes() const;
  // Tiles that the update changed.
  uint64_t tiles_changed() const;

 private:
  const std::unique_ptr<const Content> content_;
};

}  // namespace silhouette::client
