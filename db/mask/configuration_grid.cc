// SPDX-License-Identifier: Apache-2.0
#include "db/mask/configuration_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kSnap = 1e-6;      // in steps
constexpr double kMostSteps = 1e9;  // beyond it doubles become coarser than kSnap
constexpr uint64_t kMaxConfigurations = uint64_t{1} << 40;
constexpr int kTileBits = 12;  // 4096 == 1 << 12

void RequireJointCount(size_t joints) {
  if (joints < 1 || joints > kMaxJoints) {
    throw std::invalid_argument("a grid has 1 to 7 joints, not " + std::to_string(joints));
  }
}

void ConfigurationGridRequireValid(const GridJoint& joint) {
  const std::string name = "joint '" + joint.name + "'";
  if (!std::isfinite(joint.lower) || !std::isfinite(joint.upper) || joint.lower > joint.upper) {
    throw std::invalid_argument(name + ": lower and upper must be finite, lower <= upper");
  }
  if (joint.steps < 1) throw std::invalid_argument(name + ": steps must be at least 1");
  if (joint.steps != 1 && joint.lower == joint.upper) {
    throw std::invalid_argument(name + ": lower == upper goes with one step");
  }
  if (joint.continuous && std::abs(joint.upper - joint.lower - kTurn) > 1e-6) {
    throw std::invalid_argument(name + ": a continuous joint spans one turn, 2 pi");
  }
  if (joint.continuous && joint.steps == 2) {
    throw std::invalid_argument(name + ": a continuous joint needs at least 3 steps");
  }
}

void RequireValidEdges(std::span<const int> edges, size_t joints) {
  uint64_t product = 1;
  for (int edge : edges) {
    if (edge < 1 || edge > static_cast<int>(kTileSize) || (edge & (edge - 1)) != 0) {
      throw std::invalid_argument("tile edges must be powers of two");
    }
    product *= static_cast<uint64_t>(edge);
  }
  if (edges.size() != joints || product != kTileSize) {
    throw std::invalid_argument("there must be one tile edge per joint, with product 4096");
  }
}

// How many places tiles have for a configuration.
double Padding(std::span<const GridJoint> joints, std::span<const int> exponents) {
  double padding = 1;
  for (size_t j = 0; j < joints.size(); ++j) {
    const int edge = 1 << exponents[j];
    const int64_t padded = (int64_t{joints[j].steps} + edge - 1) / edge * edge;
    padding *= static_cast<double>(padded) / joints[j].steps;
  }
  return padding;
}

// How much the images of a tile change along its edges, that of one image included.
double Change(std::span<const GridJoint> joints, std::span<const double> change_per_step,
              std::span<const int> exponents) {
  double change = std::max(std::ranges::max(change_per_step), 1e-12);
  for (size_t j = 0; j < joints.size(); ++j) {
    change += (std::min(1 << exponents[j], joints[j].steps) - 1) * change_per_step[j];
  }
  return change;
}

// All ways to share kTileBits doublings among the joints: 18,564 for seven.
std::vector<std::vector<int>> AllExponents(size_t joints) {
  std::vector<std::vector<int>> all;
  std::vector<int> exponents(joints, 0);
  const auto share = [&](const auto& self, size_t j, int left) -> void {
    if (j + 1 == joints) {
      exponents[j] = left;
      all.push_back(exponents);
      return;
    }
    for (int e = 0; e <= left; ++e) {
      exponents[j] = e;
      self(self, j + 1, left - e);
    }
  };
  share(share, 0, kTileBits);
  return all;
}

}  // namespace

double GridJoint::step() const {
  if (steps <= 1) return 0;
  return (upper - lower) / (continuous ? steps : steps - 1);
}

ConfigurationGrid::ConfigurationGrid(std::vector<GridJoint> joints, std::vector<int> tile_edges)
    : joints_(std::move(joints)), tile_edges_(std::move(tile_edges)) {
  RequireJointCount(joints_.size());
  size_ = 1;
  for (size_t j = 0; j < joints_.size(); ++j) {
    ConfigurationGridRequireValid(joints_[j]);
    for (size_t i = 0; i < j; ++i) {
      if (joints_[i].name == joints_[j].name) {
        throw std::invalid_argument("joint '" + joints_[j].name + "' is named twice");
      }
    }
    const auto steps = static_cast<uint64_t>(joints_[j].steps);
    if (steps > kMaxConfigurations / size_) {
      throw std::invalid_argument("the grid has more than 2^40 configurations: use fewer steps");
    }
    size_ *= steps;
  }
  if (tile_edges_.empty()) tile_edges_ = ChooseTileEdges(joints_);
  RequireValidEdges(tile_edges_, joints_.size());
  tiles_ = 1;
  for (size_t j = 0; j < joints_.size(); ++j) {
    tile_counts_.push_back(
        static_cast<uint64_t>((int64_t{joints_[j].steps} + tile_edges_[j] - 1) / tile_edges_[j]));
    tiles_ *= tile_counts_.back();
  }
}

bool ConfigurationGrid::has_any() const { return std::ranges::any_of(joints_, &GridJoint::any); }

bool ConfigurationGrid::Contains(ConfigurationNumber number) const {
  return IndexOf(number).has_value();
}

ConfigurationNumber ConfigurationGrid::NumberOf(const GridIndex& index) const {
  uint64_t tile = 0;
  uint64_t place = 0;
  for (size_t j = 0; j < joints_.size(); ++j) {
    if (index[j] < 0 || index[j] >= joints_[j].steps) throw std::out_of_range("outside the grid");
    tile = tile * tile_counts_[j] + static_cast<uint64_t>(index[j] / tile_edges_[j]);
    place = place * tile_edges_[j] + static_cast<uint64_t>(index[j] % tile_edges_[j]);
  }
  return tile * kTileSize + place;
}

std::optional<GridIndex> ConfigurationGrid::IndexOf(ConfigurationNumber number) const {
  if (number >= number_limit()) return std::nullopt;
  uint64_t tile = number / kTileSize;
  uint64_t place = number % kTileSize;
  GridIndex index{};
  for (int j = dimensions() - 1; j >= 0; --j) {
    const uint64_t edge = static_cast<uint64_t>(tile_edges_[j]);
    const uint64_t step = tile % tile_counts_[j] * edge + place % edge;
    if (step >= static_cast<uint64_t>(joints_[j].steps)) return std::nullopt;
    index[j] = static_cast<int>(step);
    tile /= tile_counts_[j];
    place /= edge;
  }
  return index;
}

Configuration ConfigurationGrid::At(const GridIndex& index) const {
  Configuration q(joints_.size());
  for (size_t j = 0; j < joints_.size(); ++j) {
    const GridJoint& joint = joints_[j];
    if (index[j] < 0 || index[j] >= joint.steps) throw std::out_of_range("outside the grid");
    const bool last = !joint.continuous && joint.steps > 1 && index[j] == joint.steps - 1;
    q[j] = last          ? joint.upper
           : joint.any() ? std::midpoint(joint.lower, joint.upper)
                         : joint.lower + index[j] * joint.step();
  }
  return q;
}

Configuration ConfigurationGrid::At(ConfigurationNumber number) const {
  const std::optional<GridIndex> index = IndexOf(number);
  if (!index) throw std::out_of_range("no configuration has this number");
  return At(*index);
}

std::optional<double> ConfigurationGrid::Place(int j, double value) const {
  const GridJoint& joint = joints_[static_cast<size_t>(j)];
  if (!std::isfinite(value)) return std::nullopt;
  if (joint.steps == 1) {
    const bool all = joint.continuous && joint.any();
    if (!all && !(value >= joint.lower - kSnap && value <= joint.upper + kSnap)) {
      return std::nullopt;
    }
    return 0.0;
  }
  double place = (value - joint.lower) / joint.step();
  if (joint.continuous) {
    if (std::abs(place) > kMostSteps) return std::nullopt;
    place -= std::floor(place / joint.steps) * joint.steps;
  }
  const double last = joint.continuous ? joint.steps : joint.steps - 1;
  if (!(place >= -kSnap && place <= last + kSnap)) return std::nullopt;
  const int below = static_cast<int>(place);
  const double nearest = place - below > 0.5 ? below + 1 : below;
  if (std::abs(place - nearest) > kSnap) return place;
  return joint.continuous && nearest == joint.steps ? 0 : nearest;
}

std::optional<ConfigurationNumber> ConfigurationGrid::Nearest(std::span<const double> q) const {
  if (q.size() != joints_.size()) return std::nullopt;
  GridIndex index{};
  for (int j = 0; j < dimensions(); ++j) {
    const std::optional<double> place = Place(j, q[j]);
    if (!place) return std::nullopt;
    index[j] = static_cast<int>(std::lround(*place)) % joints_[j].steps;
  }
  return NumberOf(index);
}

CellCorners ConfigurationGrid::CornersAround(std::span<const double> q) const {
  CellCorners corners;
  if (q.size() != joints_.size()) return corners;
  GridIndex low{};
  GridIndex high{};
  for (int j = 0; j < dimensions(); ++j) {
    const std::optional<double> place = Place(j, q[j]);
    if (!place) return corners;
    low[j] = static_cast<int>(std::floor(*place));
    high[j] = static_cast<int>(std::ceil(*place)) % joints_[j].steps;
  }
  for (int choice = 0; choice < (1 << dimensions()); ++choice) {
    GridIndex corner = low;
    bool repeated = false;
    for (int j = 0; j < dimensions(); ++j) {
      if (((choice >> j) & 1) == 0) continue;
      repeated = repeated || high[j] == low[j];
      corner[j] = high[j];
    }
    if (!repeated) corners.numbers_[static_cast<size_t>(corners.count_++)] = NumberOf(corner);
  }
  return corners;
}

std::optional<GridIndex> ConfigurationGrid::Neighbour(const GridIndex& index, int j,
                                                      int delta) const {
  const GridJoint& joint = joints_[static_cast<size_t>(j)];
  GridIndex neighbour = index;
  int step = index[j] + delta;
  if (joint.continuous) step = ((step % joint.steps) + joint.steps) % joint.steps;
  if (step < 0 || step >= joint.steps) return std::nullopt;
  neighbour[j] = step;
  return neighbour;
}

std::vector<int> ChooseTileEdges(std::span<const GridJoint> joints,
                                 std::span<const double> change_per_step) {
  RequireJointCount(joints.size());
  std::vector<double> change(change_per_step.begin(), change_per_step.end());
  if (change.empty()) change.assign(joints.size(), 1);
  if (change.size() != joints.size()) throw std::invalid_argument("not a change for each joint");
  for (const double step : change) {
    if (!(step >= 0) || !std::isfinite(step)) throw std::invalid_argument("a change is no number");
  }
  const std::vector<std::vector<int>> all = AllExponents(joints.size());
  double least_padding = std::numeric_limits<double>::infinity();
  for (const std::vector<int>& exponents : all) {
    least_padding = std::min(least_padding, Padding(joints, exponents));
  }
  // Absent places take memory, too, whatever an index may save by them.
  constexpr double kMostPadding = 3;
  std::vector<int> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const std::vector<int>& exponents : all) {
    const double padding = Padding(joints, exponents);
    const double cost = padding * Change(joints, change, exponents);
    if (padding > kMostPadding * least_padding || !(cost < best_cost * (1 - 1e-9))) continue;
    best_cost = cost;
    best = exponents;
  }
  std::vector<int> edges;
  for (int exponent : best) edges.push_back(1 << exponent);
  return edges;
}

GridJoint MaxMoveJoint(GridJoint range, std::optional<double> reach, double delta) {
  const std::string name = "joint '" + range.name + "'";
  if (!(delta > 0) || !std::isfinite(delta)) {
    throw std::invalid_argument(name + ": the largest movement must be positive");
  }
  double step = delta;
  if (reach) {
    if (!(*reach > 0) || !std::isfinite(*reach)) {
      throw std::invalid_argument(name + ": its reach must be positive");
    }
    step = 2 * std::asin(std::min(1.0, delta / (2 * *reach)));
  }
  // A range that is a whole number of steps up to rounding is not split once more.
  const double intervals = std::ceil((range.upper - range.lower) / step * (1 - 1e-12));
  if (!(intervals < 1e9))
    throw std::invalid_argument(name + ": too many steps; use a larger delta");
  const int count = static_cast<int>(intervals);
  range.steps = range.continuous ? std::max(count, 3) : count + 1;
  return range;
}

double DeltaPerJoint(double delta, int joints, MaxMoveRule rule) {
  return rule == MaxMoveRule::kSum ? delta / joints : delta;
}

}  // namespace silhouette
