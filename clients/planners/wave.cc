// SPDX-License-Identifier: Apache-2.0
#include "clients/planners/wave.h"

#include <algorithm>

namespace silhouette {
namespace {

constexpr uint8_t kAsked = 1;
constexpr uint8_t kFree = 2;
constexpr uint8_t kExpanded = 4;

}  // namespace

Wave::Wave(const ConfigurationGrid& grid, const std::vector<Move>& moves, const FreeSpace& space)
    : grid_(grid), moves_(moves), space_(space), steps_(moves.size()) {}

Wave::Tile& Wave::TileOf(ConfigurationNumber number) {
  const uint64_t tile = number / kTileSize;
  if (last_tile_ == nullptr || last_tile_number_ != tile) {
    std::unique_ptr<Tile>& entry = tiles_[tile];
    if (entry == nullptr) entry = std::make_unique<Tile>();
    last_tile_ = entry.get();
    last_tile_number_ = tile;
  }
  return *last_tile_;
}

bool Wave::IsFree(ConfigurationNumber number) {
  uint8_t& flags = TileOf(number).flags[number % kTileSize];
  if ((flags & kAsked) == 0) flags |= space_.point(number) ? kAsked | kFree : kAsked;
  return (flags & kFree) != 0;
}

void Wave::Seed(ConfigurationNumber number, Cost cost) { Reach(number, cost); }

void Wave::Reach(ConfigurationNumber number, Cost cost) {
  Cost& known = TileOf(number).cost[number % kTileSize];
  if (cost >= known) return;
  if (known == kUnreached) ++visited_;
  known = cost;
  fronts_[(cost >> kCostBits) % fronts_.size()].push_back(number);
}

void Wave::Spread(const std::vector<Target>& targets) {
  std::vector<ConfigurationNumber> front;
  for (Cost steps = 0;; ++steps) {
    Cost cheapest = kUnreached;
    for (const Target& target : targets) {
      const Cost cost = CostAt(target.number);
      if (cost != kUnreached) cheapest = std::min(cheapest, cost + target.join);
    }
    // What is not reached yet costs at least `steps`.
    if (cheapest != kUnreached && cheapest <= steps << kCostBits) return;
    if (std::all_of(fronts_.begin(), fronts_.end(), [](const auto& f) { return f.empty(); })) {
      return;
    }
    front.clear();
    front.swap(fronts_[steps % fronts_.size()]);
    for (ConfigurationNumber number : front) Expand(number);
  }
}

void Wave::Expand(ConfigurationNumber number) {
  Tile& tile = TileOf(number);
  uint8_t& flags = tile.flags[number % kTileSize];
  if ((flags & kExpanded) != 0) return;
  flags |= kExpanded;
  const Cost cost = tile.cost[number % kTileSize];
  const std::vector<Step>& steps = StepsFrom(*grid_.IndexOf(number));
  for (size_t m = 0; m < steps.size(); ++m) {
    if (steps[m].allowed) Reach(steps[m].number, cost + moves_[m].cost);
  }
}

Cost Wave::CostAt(ConfigurationNumber number) {
  const auto found = tiles_.find(number / kTileSize);
  return found == tiles_.end() ? kUnreached : found->second->cost[number % kTileSize];
}

int Wave::Descend(const GridIndex& index, int last) {
  const Cost cost = CostAt(grid_.NumberOf(index));
  const std::vector<Step>& steps = StepsFrom(index);
  const auto leads_down = [&](size_t m) {
    if (!steps[m].allowed) return false;
    const Cost end = CostAt(steps[m].number);
    return end != kUnreached && end + moves_[m].cost == cost;
  };
  if (last >= 0 && leads_down(static_cast<size_t>(last))) return last;
  for (size_t m = 0; m < steps.size(); ++m) {
    if (leads_down(m)) return static_cast<int>(m);
  }
  return -1;
}

const std::vector<Wave::Step>& Wave::StepsFrom(const GridIndex& index) {
  const ConfigurationNumber from = grid_.NumberOf(index);
  for (size_t m = 0; m < moves_.size(); ++m) {
    const Move& move = moves_[m];
    Step& step = steps_[m];
    if (move.parts.empty()) {
      const std::optional<GridIndex> end = After(grid_, index, move);
      step.box_is_free = end.has_value();
      if (end) step.number = grid_.NumberOf(*end);
    } else {
      step.box_is_free = std::all_of(move.parts.begin(), move.parts.end(), [&](int part) {
        return steps_[static_cast<size_t>(part)].box_is_free;
      });
      // A number is a sum over the joints.
      step.number = steps_[static_cast<size_t>(move.parts.front())].number +
                    (steps_[static_cast<size_t>(move.rest)].number - from);
    }
    step.box_is_free = step.box_is_free && IsFree(step.number);
    step.allowed = step.box_is_free && (!space_.move || space_.move(from, step.number));
  }
  return steps_;
}

}  // namespace silhouette
