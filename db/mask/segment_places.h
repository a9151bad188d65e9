// SPDX-License-Identifier: Apache-2.0
// The places of a straight line, in joint values, that have to be tested so that nothing between
// them is left out.
//
// What stands for a configuration changes only where a joint passes a grid value (another grid
// cell) or, if the nearest grid point stands for it, lies half-way between two. Testing all these
// crossings, and one place between each two of them, tests the line exactly - up to cells that it
// touches for less than the millionth of a step to which the grid snaps.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "db/mask/configuration_grid.h"

namespace silhouette {

class SegmentPlaces {
 public:
  // Where another place begins.
  enum class Border { kGridValues, kHalfWay };

  // The line from `from`, a configuration in the grid, to `to`, which may lie outside. Values are
  // interpolated as they are: a continuous joint takes the way that they say, over as many turns.
  // Both have one value per joint, else std::invalid_argument. Never allocates.
  SegmentPlaces(const ConfigurationGrid& grid, std::span<const double> from,
                std::span<const double> to, Border border);

  // False if the line is too long to be resolved in steps: a value that is not finite, or a
  // continuous joint more than a billion steps away. Then Next() gives nothing.
  bool resolvable() const { return resolvable_; }

  // The next place as fraction of the line, greater than 0, less than 1, never falling; nothing
  // after the last. The ends themselves are not among them.
  std::optional<double> Next();

 private:
  struct Axis {
    double from = 0;   // in steps
    double delta = 0;  // in steps, over the whole line
    double next = 0;   // the next crossing, in steps
    double fraction() const { return (next - from) / delta; }
  };

  double NextCrossing();

  std::array<Axis, kMaxJoints> axes_;  // of the joints that move
  int moving_ = 0;
  bool resolvable_ = true;
  double leaves_grid_ = 2;  // where the line leaves the grid; 2: it does not
  double last_crossing_ = 0;
  std::optional<double> pending_;  // a crossing whose middle place was given last
};

}  // namespace silhouette
