// The parts that a set of voxels is worked on in.
#pragma once

#include <array>
#include <climits>
#include <utility>
#include <vector>

#include "server/collision/voxel_grid.h"

namespace silhouette {

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
