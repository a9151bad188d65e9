// SPDX-License-Identifier: Apache-2.0
#include "db/store/fixed_joints.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace silhouette {

FixedJointRanges::FixedJointRanges(const storage::v1::CellDescription& cell)
    : grid_joints_(static_cast<size_t>(cell.grid_joints_size())) {
  for (const storage::v1::FixedJoint& joint : cell.fixed_joints()) {
    ranges_.push_back({joint.name(), joint.position(), joint.position(), joint.position()});
  }
}

std::span<const double> FixedJointRanges::FixedOf(std::span<const double> measured) const {
  if (measured.size() != grid_joints_ + ranges_.size()) return {};
  return measured.subspan(grid_joints_);
}

std::optional<std::string> FixedJointRanges::Elsewhere(std::span<const double> measured,
                                                       double tolerance) const {
  const std::span<const double> fixed = FixedOf(measured);
  for (size_t i = 0; i < fixed.size(); ++i) {
    const FixedJointRange& joint = ranges_[i];
    if (std::abs(fixed[i] - joint.position) <= tolerance) continue;
    return absl::StrCat("joint '", joint.name, "' at ", fixed[i], " instead of ", joint.position);
  }
  return std::nullopt;
}

void FixedJointRanges::Add(std::span<const double> measured) {
  const std::span<const double> fixed = FixedOf(measured);
  for (size_t i = 0; i < fixed.size(); ++i) {
    ranges_[i].lowest = std::min(ranges_[i].lowest, fixed[i]);
    ranges_[i].highest = std::max(ranges_[i].highest, fixed[i]);
  }
}

}  // namespace silhouette
