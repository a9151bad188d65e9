// SPDX-License-Identifier: Apache-2.0
// JointRegions: boxes of joint values that a robot must never enter. Part of the pure core.
//
// Bounds belong to their region. Radians, for prismatic joints metres. Cannot be changed once made;
// used by any number of threads.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace silhouette {

// The values that a region holds of one joint; of a joint that turns without end, every turn of
// them.
struct RegionRange {
  size_t joint = 0;
  bool continuous = false;
  double lower = 0;
  double upper = 0;
};

class JointRegions {
 public:
  // What holds the values of all of its ranges; joints without a range have any value.
  using Region = std::vector<RegionRange>;

  JointRegions() = default;  // nowhere
  // Throws std::invalid_argument if a region has no range, or one whose bounds are not finite and
  // in order.
  explicit JointRegions(std::vector<Region> regions);

  bool empty() const { return regions_.empty(); }
  const std::vector<Region>& regions() const { return regions_; }
  // Whether every range names one of the joints 0 to `joints` - 1.
  bool Fits(size_t joints) const;

  // The number of the first region that a move between two configurations may touch; nothing if
  // none. The joints may move at any speed against each other, but each stays between its two
  // values: the whole box that the two configurations span is looked at. Both have a value for
  // each joint that Fits.
  std::optional<size_t> Between(std::span<const double> from, std::span<const double> to) const;

 private:
  std::vector<Region> regions_;
};

}  // namespace silhouette
