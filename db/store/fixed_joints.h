// SPDX-License-Identifier: Apache-2.0
// Where the joints outside the grid stood when robot images were captured.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Radians, metres. From `lowest` to `highest` are all places at which robot images say that they
// were captured, and the cell's own.
struct FixedJointRange {
  std::string name;
  double position = 0;  // as the cell has it
  double lowest = 0;
  double highest = 0;
};

// Collects them from records. For one thread at a time. `measured` is RobotImage::measured; if it
// is empty, nothing is known but what the cell says, and that holds.
class FixedJointRanges {
 public:
  // Nothing but what the cell says: the ranges are points.
  explicit FixedJointRanges(const storage::v1::CellDescription& cell);

  // One per fixed joint, in the cell's order.
  const std::vector<FixedJointRange>& ranges() const { return ranges_; }

  // Which fixed joint is further than `tolerance` from where the cell has it, or not a number, e.g.
  // "joint 'track' at 0.8 instead of 0.5"; nothing if none is.
  std::optional<std::string> Elsewhere(std::span<const double> measured, double tolerance) const;

  // Widens the ranges so that they hold what was measured.
  void Add(std::span<const double> measured);

 private:
  // Those of the fixed joints; none if there are not as many as the cell has joints.
  std::span<const double> FixedOf(std::span<const double> measured) const;

  size_t grid_joints_ = 0;
  std::vector<FixedJointRange> ranges_;
};

}  // namespace silhouette
