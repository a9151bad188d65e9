// The connected parts of a set of voxels.
#pragma once

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

}  // namespace silhouette
