// SPDX-License-Identifier: Apache-2.0
#include "db/mask/joint_regions.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

bool MeetsRange(const RegionRange& range, double from, double to) {
  const auto [least, greatest] = std::minmax(from, to);
  if (!range.continuous) return least <= range.upper && greatest >= range.lower;
  // Some turn of the range ends at `least` or later, the first such must begin before `greatest`.
  constexpr double kWholeTurn = 2 * std::numbers::pi;
  return range.lower + std::ceil((least - range.upper) / kWholeTurn) * kWholeTurn <= greatest;
}

}  // namespace

JointRegions::JointRegions(std::vector<Region> regions) : regions_(std::move(regions)) {
  for (const Region& region : regions_) {
    if (region.empty()) throw std::invalid_argument("a region bounds no joint");
    for (const RegionRange& range : region) {
      if (std::isfinite(range.lower) && std::isfinite(range.upper) && range.lower <= range.upper) {
        continue;
      }
      throw std::invalid_argument("a region has bounds that are not finite and in order");
    }
  }
}

bool JointRegions::Fits(size_t joints) const {
  return std::ranges::all_of(regions_, [joints](const Region& region) {
    return std::ranges::all_of(region,
                               [joints](const RegionRange& range) { return range.joint < joints; });
  });
}

std::optional<size_t> JointRegions::Between(std::span<const double> from,
                                            std::span<const double> to) const {
  for (size_t i = 0; i < regions_.size(); ++i) {
    if (std::ranges::all_of(regions_[i], [&](const RegionRange& range) {
          return MeetsRange(range, from[range.joint], to[range.joint]);
        })) {
      return i;
    }
  }
  return std::nullopt;
}

}  // namespace silhouette
