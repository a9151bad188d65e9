// SPDX-License-Identifier: Apache-2.0
// The configuration grid: the discretised configurations of a robot and their numbers.
//
// Along each joint the grid has `steps` evenly spaced values. A bounded joint has its first value
// at `lower` and its last at `upper`; a continuous joint spans one turn, `lower` to `upper`, whose
// last value is one step short of `upper` and neighbours the first.
//
// A tile is a box of 4096 neighbouring configurations; its edges, in grid steps, are powers of two.
// The number of a configuration is tile * 4096 + place, both row-major with the last joint running
// fastest, so that neighbours lie together. Places of a tile beyond the grid's rim are absent: they
// have a number that no configuration has.
//
// A joint with a range and one step has one value that stands for any of its range: neighbours
// differ in other joints. No captured robot image is of such a grid; drawn ones are (DrawnKind).
//
// Values are in radians, for prismatic joints in metres. A grid cannot be changed once made.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace silhouette {

inline constexpr int kMaxJoints = 7;
inline constexpr uint64_t kTileSize = 4096;

// Joint values in the grid's joint order, radians or metres.
using Configuration = std::vector<double>;

// tile * kTileSize + place.
using ConfigurationNumber = uint64_t;

// Step along each joint, 0 <= index[j] < steps; entries beyond the grid's joints are 0.
using GridIndex = std::array<int, kMaxJoints>;

struct GridJoint {
  std::string name;
  double lower = 0;
  double upper = 0;
  int steps = 1;            // number of grid values, at least 1
  bool continuous = false;  // a revolute joint that turns without end

  // Distance between neighbouring values; 0 where there is one value only.
  double step() const;
  // Whether its one value stands for any from lower to upper; of a continuous joint for all.
  bool any() const { return steps == 1 && lower < upper; }
  bool operator==(const GridJoint&) const = default;
};

// The corners of the grid cell around a configuration: 1 (on a grid point) to 2^7.
class CellCorners {
 public:
  std::span<const ConfigurationNumber> numbers() const {
    return {numbers_.data(), static_cast<size_t>(count_)};
  }
  int count() const { return count_; }

 private:
  friend class ConfigurationGrid;
  std::array<ConfigurationNumber, 1 << kMaxJoints> numbers_;
  int count_ = 0;
};

class ConfigurationGrid {
 public:
  // `joints`: 1 to 7, each with a unique name, finite lower <= upper, steps >= 1 (exactly 1 if
  // lower == upper), a continuous joint with a span of one turn (2 pi) and 1 or at least 3 steps.
  // `tile_edges`: one power of two per joint with product 4096; empty chooses ChooseTileEdges.
  // Throws std::invalid_argument, naming the joint, where this does not hold, and if the grid has
  // more than 2^40 configurations.
  explicit ConfigurationGrid(std::vector<GridJoint> joints, std::vector<int> tile_edges = {});

  int dimensions() const { return static_cast<int>(joints_.size()); }
  std::span<const GridJoint> joints() const { return joints_; }
  std::span<const int> tile_edges() const { return tile_edges_; }

  // Number of configurations, without absent places.
  uint64_t size() const { return size_; }
  // Whether a joint has one value that stands for any.
  bool has_any() const;
  uint64_t tiles() const { return tiles_; }
  // One more than the greatest number that a place can have: tiles() * kTileSize.
  uint64_t number_limit() const { return tiles_ * kTileSize; }

  // Whether `number` is that of a configuration and not of an absent place.
  bool Contains(ConfigurationNumber number) const;

  // The number of the configuration at `index`. Throws std::out_of_range outside the grid.
  ConfigurationNumber NumberOf(const GridIndex& index) const;

  // The index of a configuration; nothing for an absent place.
  std::optional<GridIndex> IndexOf(ConfigurationNumber number) const;

  // The joint values at a grid point; where a joint stands for any, the middle of its range. Throws
  // std::out_of_range outside the grid.
  Configuration At(const GridIndex& index) const;
  Configuration At(ConfigurationNumber number) const;

  // The grid point nearest to `q` along every joint; nothing if `q` is outside the grid, is not
  // finite or has the wrong number of values.
  std::optional<ConfigurationNumber> Nearest(std::span<const double> q) const;

  // The corners of the grid cell that holds `q`; along joints where `q` is on a grid value (to a
  // millionth of a step) only that value counts. A count of 0 says that `q` is outside the grid, is
  // not finite or has the wrong number of values. Never allocates.
  CellCorners CornersAround(std::span<const double> q) const;

  // The place of `value` along joint `j` in steps, 0 to steps - 1 (continuous: less than steps),
  // snapped to a millionth of a step; nothing outside the grid, nor more than 1e9 steps away.
  std::optional<double> Place(int j, double value) const;

  // The index `delta` steps along joint `j`, wrapped on a continuous joint; nothing beyond the rim.
  std::optional<GridIndex> Neighbour(const GridIndex& index, int j, int delta) const;

  bool operator==(const ConfigurationGrid&) const = default;

 private:
  std::vector<GridJoint> joints_;
  std::vector<int> tile_edges_;
  std::vector<uint64_t> tile_counts_;  // tiles along each joint
  uint64_t size_ = 0;
  uint64_t tiles_ = 0;
};

// Powers of two with product 4096, one per joint, such that the robot images of a tile are alike
// and few places are absent: long along joints that change the images little. `change_per_step`,
// any unit, not negative: how much an image changes in a grid step of each joint; empty: all equal.
// The collision index grows with the sum of the changes along a tile's edges.
std::vector<int> ChooseTileEdges(std::span<const GridJoint> joints,
                                 std::span<const double> change_per_step = {});

// How a largest Cartesian movement bounds a grid step (Henrich, Wurll & Woern 1998).
enum class MaxMoveRule {
  kEach,  // a move of one joint obeys it; a diagonal at most the sum over its joints
  kSum,   // a move of all joints at once obeys it: each joint gets delta / number of joints
};

// The MaxMove discretisation.
// `range`: name, lower, upper and continuous are read; steps is what is found.
// `reach`: revolute joint: greatest distance, in metres, from the joint's axis of any point that
//   the joint moves; prismatic: nothing, as its step is delta itself.
// `delta`: largest movement per step in metres, already divided where MaxMoveRule asks for it.
// Returns the joint with the least number of evenly spread steps that obeys delta. Throws
// std::invalid_argument if delta or reach is not positive and finite.
GridJoint MaxMoveJoint(GridJoint range, std::optional<double> reach, double delta);

// `delta` per joint under `rule` for a grid of `joints` joints.
double DeltaPerJoint(double delta, int joints, MaxMoveRule rule);

}  // namespace silhouette
