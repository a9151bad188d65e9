// SPDX-License-Identifier: Apache-2.0
#include "server/collision/space_distances.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "server/collision/obstacle_image.h"

namespace silhouette {
namespace {

constexpr int kEdge = VoxelGrid::kBlockEdge;
constexpr size_t kRows = size_t{kEdge} * kEdge;  // of a block
constexpr int kGroupEdge = 4;                    // blocks

// Where a row of a block is, in voxels: y and z.
std::array<double, 2> PlaceOf(size_t row) {
  const auto number = static_cast<int>(row);
  const int z = number / kEdge;
  return {static_cast<double>(number % kEdge), static_cast<double>(z)};
}

// How far the ball of a body may be from a box for the body to be no farther than `distance`.
double SquareWithin(const PlacedHull& body, double distance) {
  const double within = distance + body.ball_radius();
  return within * within;
}

}  // namespace

SpaceDistances::SpaceDistances(const std::vector<VoxelsOfGrid>& sets, double range,
                               const std::optional<Eigen::AlignedBox3d>& known)
    : grid_(sets.empty() ? throw std::invalid_argument("there is no set of voxels")
                         : sets.front().grid.box()),
      range_(range),
      known_(known) {
  if (!(range > 0)) throw std::invalid_argument("a range of distances is positive");
  for (const auto& [set, grid] : sets) {
    for (int axis = 0; axis < 3; ++axis) {
      if (set.size(axis) != grid.size(axis)) {
        throw std::invalid_argument("the voxels are not of the grid");
      }
    }
    const std::vector<bool> with_voxels = BlocksWithVoxels(set);
    for (int z = 0; z < grid.blocks(2); z += kGroupEdge) {
      for (int y = 0; y < grid.blocks(1); y += kGroupEdge) {
        for (int x = 0; x < grid.blocks(0); x += kGroupEdge) {
          AddGroup({set, grid}, with_voxels, {x, y, z});
        }
      }
    }
  }
}

void SpaceDistances::AddGroup(const VoxelsOfGrid& voxels, const std::vector<bool>& with_voxels,
                              const Eigen::Vector3i& first) {
  const VoxelGrid& grid = voxels.grid;
  const auto end = [&](int axis) { return std::min(first[axis] + kGroupEdge, grid.blocks(axis)); };
  Group group{.first = blocks_.size()};
  for (int bz = first.z(); bz < end(2); ++bz) {
    for (int by = first.y(); by < end(1); ++by) {
      for (int bx = first.x(); bx < end(0); ++bx) {
        if (!with_voxels[static_cast<size_t>(grid.BlockAt(bx, by, bz))]) continue;
        Block block{.lower = grid.Corner(kEdge * bx, kEdge * by, kEdge * bz), .edge = grid.edge()};
        for (size_t row = 0; row < block.rows.size(); ++row) {
          const int y = kEdge * by + static_cast<int>(row) % kEdge;
          const int z = kEdge * bz + static_cast<int>(row) / kEdge;
          const auto bits = static_cast<uint8_t>(voxels.set.RowOfBlock(bx, y, z));
          if (bits == 0) continue;
          block.rows[row] = bits;
          block.voxels.extend(
              block.Box(row, std::countr_zero(bits), kEdge - std::countl_zero(bits)));
        }
        group.voxels.extend(block.voxels);
        blocks_.push_back(block);
      }
    }
  }
  group.last = blocks_.size();
  if (group.last > group.first) groups_.push_back(group);
}

Eigen::AlignedBox3d SpaceDistances::Block::Box(size_t row, int first, int last) const {
  const auto [y, z] = PlaceOf(row);
  return {lower + edge * Eigen::Vector3d(first, y, z),
          lower + edge * Eigen::Vector3d(last, y + 1, z + 1)};
}

double SpaceDistances::ToUnknown(const PlacedHull& body) const {
  double least = range_;
  if (!known_) return least;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      const Eigen::Vector3d outwards = side * Eigen::Vector3d::Unit(axis);
      const double end = side < 0 ? -known_->min()[axis] : known_->max()[axis];
      least = std::min(least, end - body.PlaneAt(outwards).offset);
    }
  }
  return std::max(0.0, least);
}

const SpaceDistances::Block* SpaceDistances::NearestBlock(const PlacedHull& body,
                                                          double at_most) const {
  const Block* nearest = nullptr;
  double begins = SquareWithin(body, at_most);
  for (const Group& group : groups_) {
    if (group.voxels.squaredExteriorDistance(body.ball_centre()) >= begins) continue;
    for (size_t i = group.first; i < group.last; ++i) {
      const double to_block = blocks_[i].voxels.squaredExteriorDistance(body.ball_centre());
      if (to_block >= begins) continue;
      begins = to_block;
      nearest = &blocks_[i];
    }
  }
  return nearest;
}

void SpaceDistances::Measure(const Block& block, const PlacedHull& body, PlacedHull::Plane& plane,
                             double& distance) {
  if (body.Distance(block.voxels, distance, plane) >= distance) return;
  constexpr double kNever = std::numeric_limits<double>::infinity();
  // By row, what the plane proves.
  std::array<double, kRows> at_least;
  const double first_row = plane.DistanceTo(block.Box(0, 0, kEdge));
  const Eigen::Vector3d step = block.edge * plane.normal;
  for (size_t row = 0; row < at_least.size(); ++row) {
    const auto [y, z] = PlaceOf(row);
    at_least[row] = block.rows[row] == 0 ? kNever : first_row + y * step.y() + z * step.z();
  }
  const auto measure = [&](size_t row) {
    for (unsigned bits = block.rows[row]; bits != 0;) {
      const int first = std::countr_zero(bits);
      const int last = first + std::countr_one(bits >> first);
      distance = std::min(distance, body.Distance(block.Box(row, first, last), distance, plane));
      bits &= ~0U << last;
    }
  };
  const auto nearest = static_cast<size_t>(std::ranges::min_element(at_least) - at_least.begin());
  measure(nearest);
  for (size_t row = 0; row < at_least.size(); ++row) {
    if (row != nearest && at_least[row] < distance) measure(row);
  }
}

double SpaceDistances::Distance(const PlacedHull& body, double at_most) const {
  const Eigen::Vector3d& centre = body.ball_centre();
  // No comparison holds of what is no number.
  if (!((centre.array() >= grid_.min().array()).all() &&
        (centre.array() < grid_.max().array()).all())) {
    return 0;
  }
  double distance = std::min(at_most, ToUnknown(body));
  // Of most others none is as near.
  const Block* const nearest = NearestBlock(body, distance);
  if (nearest == nullptr) return distance;
  PlacedHull::Plane plane;
  Measure(*nearest, body, plane, distance);
  for (const Group& group : groups_) {
    if (group.voxels.squaredExteriorDistance(centre) >= SquareWithin(body, distance)) continue;
    for (size_t i = group.first; i < group.last; ++i) {
      if (&blocks_[i] == nearest ||
          blocks_[i].voxels.squaredExteriorDistance(centre) >= SquareWithin(body, distance)) {
        continue;
      }
      Measure(blocks_[i], body, plane, distance);
    }
  }
  return distance;
}

}  // namespace silhouette
