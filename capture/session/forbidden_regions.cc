#include "capture/session/forbidden_regions.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

// Rounding must not let a bound slip out of its region.
constexpr double kSlack = 1e-9;

size_t JointIndex(const ConfigurationGrid& grid, const std::string& name,
                  const std::string& region) {
  const auto joints = grid.joints();
  const auto joint = std::find_if(joints.begin(), joints.end(),
                                  [&](const GridJoint& known) { return known.name == name; });
  if (joint == joints.end()) {
    throw std::invalid_argument(absl::StrCat("the forbidden region '", region, "' bounds '", name,
                                             "', which is not a joint of the grid"));
  }
  return static_cast<size_t>(joint - joints.begin());
}

}  // namespace

ForbiddenRegions::ForbiddenRegions(std::span<const ForbiddenRegion> regions,
                                   const ConfigurationGrid& grid) {
  for (const ForbiddenRegion& region : regions) {
    if (region.ranges.empty()) {
      throw std::invalid_argument(
          absl::StrCat("the forbidden region '", region.name, "' bounds no joint"));
    }
    Region known{.name = region.name, .ranges = {}};
    for (const ForbiddenRegion::Range& range : region.ranges) {
      if (!(std::isfinite(range.lower) && std::isfinite(range.upper) &&
            range.lower <= range.upper)) {
        throw std::invalid_argument(absl::StrCat("the forbidden region '", region.name,
                                                 "' has bounds of '", range.joint,
                                                 "' that are not finite and in order"));
      }
      const size_t joint = JointIndex(grid, range.joint, region.name);
      known.ranges.push_back({.joint = joint,
                              .continuous = grid.joints()[joint].continuous,
                              .lower = range.lower - kSlack,
                              .upper = range.upper + kSlack});
    }
    regions_.push_back(std::move(known));
  }
}

bool ForbiddenRegions::Range::Meets(double from, double to) const {
  const auto [least, greatest] = std::minmax(from, to);
  if (!continuous) return least <= upper && greatest >= lower;
  // Some turn of the range ends at `least` or later, the first such must begin before `greatest`.
  constexpr double kTurn = 2 * std::numbers::pi;
  return lower + std::ceil((least - upper) / kTurn) * kTurn <= greatest;
}

std::optional<std::string> ForbiddenRegions::At(std::span<const double> configuration) const {
  return Between(configuration, configuration);
}

std::optional<std::string> ForbiddenRegions::Between(std::span<const double> from,
                                                     std::span<const double> to) const {
  for (const Region& region : regions_) {
    if (std::all_of(region.ranges.begin(), region.ranges.end(), [&](const Range& range) {
          return range.Meets(from[range.joint], to[range.joint]);
        })) {
      return region.name;
    }
  }
  return std::nullopt;
}

}  // namespace silhouette
