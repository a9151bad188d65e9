// SPDX-License-Identifier: Apache-2.0
// Voxels: equal cubes that fill a box of space, and sets of them. Part of the pure core.
//
// Voxel (x, y, z) covers [lower + edge * (x, y, z), lower + edge * (x + 1, y + 1, z + 1)]. Blocks
// of kBlockEdge^3 voxels are worked on together. Metres, in the robot's base frame.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <climits>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace silhouette {

class VoxelGrid {
 public:
  static constexpr int kBlockEdge = 8;
  static constexpr int kBlockVoxels = kBlockEdge * kBlockEdge * kBlockEdge;

  // The voxels of edge length `edge` that fill `box`, and up to a block more at its upper sides.
  // Throws std::invalid_argument if the box is empty or not finite, the edge is not positive, or
  // there would be more than 2^31 voxels.
  VoxelGrid(const Eigen::AlignedBox3d& box, double edge);

  double edge() const { return edge_; }
  // Number of voxels along an axis (0 to 2): a multiple of kBlockEdge.
  int size(int axis) const { return size_[axis]; }
  int64_t voxels() const { return int64_t{size_[0]} * size_[1] * size_[2]; }
  const Eigen::Vector3d& lower() const { return lower_; }

  Eigen::Vector3d Corner(int x, int y, int z) const {
    return lower_ + edge_ * Eigen::Vector3d(x, y, z);
  }
  Eigen::AlignedBox3d Box(int x, int y, int z) const {
    return {Corner(x, y, z), Corner(x + 1, y + 1, z + 1)};
  }

  // All voxels.
  Eigen::AlignedBox3d box() const { return {lower_, Corner(size_[0], size_[1], size_[2])}; }

  int blocks(int axis) const { return size_[axis] / kBlockEdge; }
  int64_t blocks() const { return voxels() / kBlockVoxels; }
  int BlockAt(int bx, int by, int bz) const { return (bz * blocks(1) + by) * blocks(0) + bx; }

  bool operator==(const VoxelGrid&) const = default;

 private:
  Eigen::Vector3d lower_;
  double edge_ = 0;
  Eigen::Vector3i size_;
};

// A set of the voxels of a grid: per row along x one bit per voxel, bit x % 64 of word x / 64 of
// row (y, z). A plain value.
class VoxelSet {
 public:
  VoxelSet() = default;
  // No voxel.
  explicit VoxelSet(const VoxelGrid& grid);

  int size(int axis) const { return size_[axis]; }
  size_t row_words() const { return row_words_; }

  std::span<uint64_t> row(int y, int z) { return {words_.data() + RowStart(y, z), row_words_}; }
  std::span<const uint64_t> row(int y, int z) const {
    return {words_.data() + RowStart(y, z), row_words_};
  }
  std::span<uint64_t> words() { return words_; }
  std::span<const uint64_t> words() const { return words_; }

  bool at(int x, int y, int z) const {
    return (row(y, z)[static_cast<size_t>(x) / 64] >> (x % 64) & 1) != 0;
  }
  void Insert(int x, int y, int z) {
    row(y, z)[static_cast<size_t>(x) / 64] |= uint64_t{1} << (x % 64);
  }
  // Voxels first..last of a row.
  void InsertRun(int first, int last, int y, int z);
  // The kBlockEdge voxels of a row that lie in block `bx`, bit 0 first.
  unsigned RowOfBlock(int bx, int y, int z) const {
    return static_cast<unsigned>(row(y, z)[static_cast<size_t>(bx) / 8] >> (8 * (bx % 8))) & 0xff;
  }
  void InsertRowOfBlock(int bx, int y, int z, unsigned bits) {
    row(y, z)[static_cast<size_t>(bx) / 8] |= uint64_t{bits} << (8 * (bx % 8));
  }

  int64_t Count() const;
  bool Empty() const;

  bool operator==(const VoxelSet&) const = default;

 private:
  size_t RowStart(int y, int z) const { return static_cast<size_t>(z * size_[1] + y) * row_words_; }

  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  size_t row_words_ = 0;
  std::vector<uint64_t> words_;
};

// By block (VoxelGrid::BlockAt): whether any of its voxels is in the set.
std::vector<bool> BlocksWithVoxels(const VoxelSet& set);

// Voxels of one grid by their places in another. Refers to both, which must outlive it.
class OtherGrid {
 public:
  OtherGrid(const VoxelGrid& from, const VoxelGrid& to) : from_(from), to_(to) {}

  // The voxels of `to` along an axis, first and last, that voxel `place` of `from` has a part of;
  // where that is beyond `to`, the voxel at its rim.
  std::pair<int, int> Touched(int axis, int place) const;

 private:
  const VoxelGrid& from_;
  const VoxelGrid& to_;
};

// Adds to `set`, of `to`, the voxels that have a part of one of `voxels`, of `from`.
void AddTouched(const VoxelSet& voxels, const VoxelGrid& from, const VoxelGrid& to, VoxelSet& set);

// The voxels that a ball of `radius` meets whose centre lies somewhere in a voxel of `centres`:
// none that such a ball could meet is left out. Metres; `grid` is the set's.
VoxelSet MetByBalls(const VoxelSet& centres, const VoxelGrid& grid, double radius);

// The voxels of a set that have a neighbour, of six, which is not in it or not in the grid.
VoxelSet Surface(const VoxelSet& set);

// The parts that a set of voxels is worked on in.
// Neighbouring voxels of a row: (first..last, y, z).
struct VoxelRun {
  int y = 0;
  int z = 0;
  int first = 0;
  int last = 0;
  int part = 0;

  bool operator==(const VoxelRun&) const = default;
};

// The set in runs as long as they can be, row by row. Voxels are connected if they share a face, an
// edge or a corner. Parts are numbered from 0, the largest first; beyond `most` of them, at least
// 1, all smaller ones are one part, the last.
std::vector<VoxelRun> ConnectedParts(const VoxelSet& set, int most);

// Some voxels, and the box that they fill: lowest and highest coordinates, both included.
struct VoxelPart {
  std::vector<VoxelRun> runs;
  std::array<int, 3> low{INT_MAX, INT_MAX, INT_MAX};
  std::array<int, 3> high{INT_MIN, INT_MIN, INT_MIN};

  void Add(const VoxelRun& run);
  // Voxels along the longest edge of the box; 0: the part is empty.
  int Length() const;
};

// By the numbers of their runs.
std::vector<VoxelPart> PartsOf(const std::vector<VoxelRun>& runs);

// The voxels on both sides of the middle of the longest edge; neither is empty. `part` is longer
// than 1.
std::pair<VoxelPart, VoxelPart> Halves(const VoxelPart& part);

}  // namespace silhouette
