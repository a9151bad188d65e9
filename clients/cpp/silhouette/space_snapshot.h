// SPDX-License-Identifier: Apache-2.0
// The verdicts of one scene: what LocalSpace holds. Of a captured robot a map of the configuration
// space; of a drawn one what decides any configuration.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>

#include "absl/time/time.h"
#include "silhouette/answers.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/configuration_space.h"
#include "silhouette/running_clock.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// The verdict on a straight motion. Fractions are of the way, 0 to 1.
struct MotionVerdict {
  // Free if all of the motion is. Otherwise the verdict at the first place that is not.
  State state = State::kUnknown;
  Reason reason = Reason::kUnspecified;
  // That place: its fraction and its joint values, as many as the robot has. Only if not free.
  double fraction = 0;
  std::array<double, kMaxJoints> place{};
  // All of the motion up to this fraction is free; 0 also if the start is not.
  double last_free = 0;
  // Number of places checked, up to there.
  int64_t checked = 0;
  // As in PathCheck.
  PathProof proof = PathProof::kNone;
  double sampled_step = 0;

  bool free() const { return state == State::kFree; }
};

// The verdicts of one scene and the end of their validity: after it everything is unknown.
// Immutable; any number of threads may read it.
class SpaceSnapshot : public std::enable_shared_from_this<SpaceSnapshot> {
 public:
  struct Content;
  explicit SpaceSnapshot(std::unique_ptr<const Content> content);
  ~SpaceSnapshot();
  SpaceSnapshot(const SpaceSnapshot&) = delete;
  SpaceSnapshot& operator=(const SpaceSnapshot&) = delete;

  // The scene, and its age, which is never too small.
  const Basis& basis() const;
  absl::Duration Age() const { return basis().Age(); }

  // Why everything is unknown at this moment; nothing if verdicts are valid.
  std::optional<Reason> unknown_reason() const;

  // When the validity ends or ended.
  RunningClock::time_point usable_until() const;

  // Null before the first update.
  const ConfigurationGrid* grid() const;

  // Looks at the clock each time; unknown also for a number that no configuration of the grid has.
  // Numbers are those of grid(), which another database changes.
  // Of a drawn robot only if tiles were requested, or the server has a collision index.
  State StateAt(ConfigurationNumber number) const;
  bool IsFree(ConfigurationNumber number) const { return StateAt(number) == State::kFree; }

  // The verdict for a configuration, on the grid or off it: the server's verdict, or unknown with
  // the reason (kBetweenGridPoints: off the grid the map may not suffice; see docs/concepts.md). Of
  // a drawn robot always the server's verdict, in microseconds. With another number of joint values
  // than grid() has joints: unknown, kOutsideGrid.
  // Without evidence and hidden_possible; names all allowed regions of the scene.
  Verdict Check(std::span<const double> q) const;
  Verdict Check(std::initializer_list<double> q) const {
    return Check(std::span(q.begin(), q.size()));
  }

  // The straight motion between two configurations: what Client::CheckPath of these two waypoints
  // returns, with the same restrictions as Check. Between grid points the map of a captured robot
  // may not suffice: unknown, kBetweenGridPoints (LocalSpace::CheckMotionOrAsk). Never allocates
  // for a captured robot. `path_resolution`: metres that some point of a drawn robot moves, as in
  // CheckPathRequest; for any robot std::invalid_argument if it is not 0.0005 to 0.1. A motion that
  // takes more than a million checks is unknown, kNotCheckedHere.
  MotionVerdict CheckMotion(std::span<const double> from, std::span<const double> to,
                            double path_resolution = 0.005) const;

  // Many at once, with one look at the clock.
  ConfigurationChecks CheckConfigurations(std::span<const Configuration> configurations) const;
  NumberChecks CheckNumbers(std::span<const uint32_t> numbers) const;

  // Over all configurations of the grid, at this moment; zeros without a grid.
  StateCounts Count() const;

  // Counts up with every update and every loss of the connection.
  uint64_t number() const;
  // Scenes since the previous update, without an update of their own.
  uint64_t skipped_scenes() const;
  // Tiles that the update changed.
  uint64_t tiles_changed() const;

 private:
  // The map's verdict, expired or not.
  Verdict InMap(std::span<const double> q) const;

  const std::unique_ptr<const Content> content_;
};

}  // namespace silhouette::client
