// SPDX-License-Identifier: Apache-2.0
#include "capture/session/travel.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <queue>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

size_t At(int j) { return static_cast<size_t>(j); }

int StepsBetween(const GridIndex& a, const GridIndex& b) {
  int steps = 0;
  for (size_t j = 0; j < a.size(); ++j) steps += std::abs(a[j] - b[j]);
  return steps;
}

absl::Status NoWay(const std::string& region) {
  return absl::FailedPreconditionError(
      absl::StrCat("there is no way around the forbidden region '", region, "'"));
}

}  // namespace

Travel::Travel(ConfigurationGrid grid, std::span<const ForbiddenRegion> regions)
    : grid_(std::move(grid)), regions_(regions, grid_) {
  if (grid_.size() > kMostConfigurations) {
    throw std::invalid_argument(absl::StrCat("the grid has ", grid_.size(),
                                             " configurations, more than any robot can visit; make "
                                             "its steps larger"));
  }
  if (!regions_.empty()) FindParts();
}

uint64_t Travel::PlaceOf(const GridIndex& index) const {
  uint64_t place = 0;
  for (int j = 0; j < grid_.dimensions(); ++j) {
    place = place * static_cast<uint64_t>(grid_.joints()[At(j)].steps) +
            static_cast<uint64_t>(index[At(j)]);
  }
  return place;
}

GridIndex Travel::IndexAt(uint64_t place) const {
  GridIndex index{};
  for (int j = grid_.dimensions() - 1; j >= 0; --j) {
    const auto steps = static_cast<uint64_t>(grid_.joints()[At(j)].steps);
    index[At(j)] = static_cast<int>(place % steps);
    place /= steps;
  }
  return index;
}

std::vector<ConfigurationNumber> Travel::Serpentine() const {
  std::vector<int> order(At(grid_.dimensions()));  // slowest joint first
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return grid_.joints()[At(a)].step() > grid_.joints()[At(b)].step();
  });
  std::vector<ConfigurationNumber> numbers;
  numbers.reserve(grid_.size());
  GridIndex index{};
  GridIndex direction;
  direction.fill(1);
  while (true) {
    numbers.push_back(grid_.NumberOf(index));
    // The fastest joint that can go on does; those faster than it turn round.
    auto joint = order.rbegin();
    for (; joint != order.rend(); ++joint) {
      const int next = index[At(*joint)] + direction[At(*joint)];
      if (next >= 0 && next < grid_.joints()[At(*joint)].steps) break;
      direction[At(*joint)] = -direction[At(*joint)];
    }
    if (joint == order.rend()) return numbers;
    index[At(*joint)] += direction[At(*joint)];
  }
}

bool Travel::Forbidden(const GridIndex& index) const {
  return !part_.empty() && part_[PlaceOf(index)] == 0;
}

bool Travel::Forbidden(ConfigurationNumber number) const {
  return Forbidden(grid_.IndexOf(number).value());
}

template <typename Visit>
void Travel::ForEachStep(const GridIndex& index, const Visit& visit) const {
  const Configuration here = grid_.At(index);
  for (int j = 0; j < grid_.dimensions(); ++j) {
    for (const int delta : {-1, 1}) {
      GridIndex next = index;
      next[At(j)] += delta;
      if (next[At(j)] < 0 || next[At(j)] >= grid_.joints()[At(j)].steps) continue;
      if (Forbidden(next) || regions_.Between(here, grid_.At(next))) continue;
      visit(next);
    }
  }
}

void Travel::FindParts() {
  constexpr int32_t kUnknown = -1;
  part_.assign(grid_.size(), kUnknown);
  for (uint64_t place = 0; place < grid_.size(); ++place) {
    if (regions_.At(grid_.At(IndexAt(place)))) part_[place] = 0;
  }
  parts_ = 0;
  std::vector<uint64_t> open;
  for (uint64_t first = 0; first < grid_.size(); ++first) {
    if (part_[first] != kUnknown) continue;
    part_[first] = ++parts_;
    open.push_back(first);
    while (!open.empty()) {
      const GridIndex index = IndexAt(open.back());
      open.pop_back();
      ForEachStep(index, [&](const GridIndex& next) {
        const uint64_t place = PlaceOf(next);
        if (part_[place] != kUnknown) return;
        part_[place] = parts_;
        open.push_back(place);
      });
    }
  }
}

// A*: the steps that are left at least are those that would be left without regions.
std::optional<std::vector<GridIndex>> Travel::WalkAlongGrid(const GridIndex& from,
                                                            const GridIndex& to) const {
  const uint64_t start = PlaceOf(from);
  const uint64_t goal = PlaceOf(to);
  if (Forbidden(from) || Forbidden(to) || part_[start] != part_[goal]) return std::nullopt;
  struct Reached {
    int steps = std::numeric_limits<int>::max();
    uint64_t before = 0;
  };
  std::unordered_map<uint64_t, Reached> reached;
  using Open = std::pair<int, uint64_t>;  // steps in all, place
  std::priority_queue<Open, std::vector<Open>, std::greater<>> open;
  reached[start] = {.steps = 0, .before = start};
  open.emplace(StepsBetween(from, to), start);
  while (!open.empty() && open.top().second != goal) {
    const uint64_t place = open.top().second;
    open.pop();
    const int steps = reached.at(place).steps + 1;
    ForEachStep(IndexAt(place), [&](const GridIndex& next) {
      const uint64_t next_place = PlaceOf(next);
      Reached& known = reached[next_place];
      if (steps >= known.steps) return;
      known = {.steps = steps, .before = place};
      open.emplace(steps + StepsBetween(next, to), next_place);
    });
  }
  std::vector<GridIndex> way;
  for (uint64_t place = goal; place != start; place = reached.at(place).before) {
    way.push_back(IndexAt(place));
  }
  std::reverse(way.begin(), way.end());
  return way;
}

absl::StatusOr<std::vector<Configuration>> Travel::Route(ConfigurationNumber from,
                                                         ConfigurationNumber to) const {
  const Configuration start = grid_.At(from);
  const Configuration goal = grid_.At(to);
  const std::optional<std::string> in_the_way = regions_.Between(start, goal);
  if (!in_the_way) return std::vector<Configuration>{goal};
  const auto way = WalkAlongGrid(grid_.IndexOf(from).value(), grid_.IndexOf(to).value());
  if (!way) return NoWay(*in_the_way);
  // As few moves as possible: each goes as far along the way as it can go straight.
  std::vector<Configuration> route;
  Configuration here = start;
  for (size_t next = 0; next < way->size(); ++next) {
    for (size_t far = way->size() - 1; far > next; --far) {
      if (regions_.Between(here, grid_.At((*way)[far]))) continue;
      next = far;
      break;
    }
    here = grid_.At((*way)[next]);
    route.push_back(here);
  }
  return route;
}

absl::StatusOr<std::vector<Configuration>> Travel::RouteFrom(const Configuration& from,
                                                             ConfigurationNumber to) const {
  if (const auto region = regions_.At(from)) {
    return absl::FailedPreconditionError(absl::StrCat("the robot stands in the forbidden region '",
                                                      *region, "'; move it out of there first"));
  }
  const std::optional<std::string> in_the_way = regions_.Between(from, grid_.At(to));
  if (!in_the_way) return std::vector<Configuration>{grid_.At(to)};
  // Straight to the nearest configuration from which the grid leads on.
  const int32_t part = part_[PlaceOf(grid_.IndexOf(to).value())];
  std::optional<GridIndex> entry;
  absl::Duration least = absl::InfiniteDuration();
  for (uint64_t place = 0; place < grid_.size() && part != 0; ++place) {
    if (part_[place] != part) continue;
    const GridIndex index = IndexAt(place);
    const Configuration there = grid_.At(index);
    const absl::Duration time = TravelTime(from, there, 1);
    if (time >= least || regions_.Between(from, there)) continue;
    least = time;
    entry = index;
  }
  if (!entry) return NoWay(*in_the_way);
  std::vector<Configuration> route = {grid_.At(*entry)};
  ASSIGN_OR_RETURN(const auto rest, Route(grid_.NumberOf(*entry), to));
  if (grid_.NumberOf(*entry) != to) route.insert(route.end(), rest.begin(), rest.end());
  return route;
}

absl::Duration TravelTime(std::span<const double> from, std::span<const double> to, double speed) {
  double farthest = 0;
  for (size_t j = 0; j < from.size(); ++j) farthest = std::max(farthest, std::abs(to[j] - from[j]));
  return absl::Seconds(farthest / speed);
}

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
  std::vector<JointRegions::Region> known_regions;
  for (const ForbiddenRegion& region : regions) {
    if (region.ranges.empty()) {
      throw std::invalid_argument(
          absl::StrCat("the forbidden region '", region.name, "' bounds no joint"));
    }
    JointRegions::Region& known = known_regions.emplace_back();
    names_.push_back(region.name);
    for (const ForbiddenRegion::Range& range : region.ranges) {
      if (!(std::isfinite(range.lower) && std::isfinite(range.upper) &&
            range.lower <= range.upper)) {
        throw std::invalid_argument(absl::StrCat("the forbidden region '", region.name,
                                                 "' has bounds of '", range.joint,
                                                 "' that are not finite and in order"));
      }
      const size_t joint = JointIndex(grid, range.joint, region.name);
      known.push_back({.joint = joint,
                       .continuous = grid.joints()[joint].continuous,
                       .lower = range.lower - kSlack,
                       .upper = range.upper + kSlack});
    }
  }
  regions_ = JointRegions(std::move(known_regions));
}

std::optional<std::string> ForbiddenRegions::At(std::span<const double> configuration) const {
  return Between(configuration, configuration);
}

std::optional<std::string> ForbiddenRegions::Between(std::span<const double> from,
                                                     std::span<const double> to) const {
  const std::optional<size_t> region = regions_.Between(from, to);
  return region ? std::optional(names_[*region]) : std::nullopt;
}

}  // namespace silhouette
