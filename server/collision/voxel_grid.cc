#include "server/collision/voxel_grid.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <stdexcept>

namespace silhouette {
namespace {

constexpr double kVoxelGridRounding = 1e-9;  // share of an edge

// `row` and its neighbours up to `reach` places to either side; words, bit 0 first.
void Widen(std::span<const uint64_t> row, int reach, std::span<uint64_t> wide) {
  std::copy(row.begin(), row.end(), wide.begin());
  const size_t words = row.size();
  for (int step = 0; step < reach; ++step) {
    uint64_t from_left = 0;
    for (size_t i = 0; i < words; ++i) {
      const uint64_t word = wide[i];
      const uint64_t from_right = i + 1 < words ? wide[i + 1] << 63 : 0;
      wide[i] = word | word << 1 | from_left | word >> 1 | from_right;
      from_left = word >> 63;
    }
  }
}

bool VoxelGridNothing(std::span<const uint64_t> words) {
  return std::all_of(words.begin(), words.end(), [](uint64_t word) { return word == 0; });
}

// How far along x the voxels reach that a ball of `radius` edges meets whose centre lies in a voxel
// `dy`, `dz` rows away; -1: none.
int ReachAlongX(double radius, int dy, int dz) {
  const int y = std::max(std::abs(dy) - 1, 0);
  const int z = std::max(std::abs(dz) - 1, 0);
  const double left = radius * radius - y * y - z * z;
  return left < 0 ? -1 : static_cast<int>(std::sqrt(left)) + 1;
}

}  // namespace

VoxelGrid::VoxelGrid(const Eigen::AlignedBox3d& box, double edge) : lower_(box.min()), edge_(edge) {
  if (!(edge > 0) || !std::isfinite(edge)) {
    throw std::invalid_argument("the edge of a voxel must be positive");
  }
  if (!box.min().allFinite() || !box.max().allFinite() || box.isEmpty()) {
    throw std::invalid_argument("a space of voxels must be a box that is finite and not empty");
  }
  double voxels = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double wanted = std::ceil(box.sizes()[axis] / edge - kVoxelGridRounding) / kBlockEdge;
    const double size = std::max(1.0, std::ceil(wanted)) * kBlockEdge;
    voxels *= size;
    if (voxels > 0x1p31) throw std::invalid_argument("there are too many voxels: make them larger");
    size_[axis] = static_cast<int>(size);
  }
}

VoxelSet::VoxelSet(const VoxelGrid& grid)
    : size_(grid.size(0), grid.size(1), grid.size(2)),
      row_words_((static_cast<size_t>(grid.size(0)) + 63) / 64),
      words_(row_words_ * static_cast<size_t>(grid.size(1)) * static_cast<size_t>(grid.size(2)),
             0) {}

int64_t VoxelSet::Count() const {
  int64_t count = 0;
  for (uint64_t word : words_) count += std::popcount(word);
  return count;
}

bool VoxelSet::Empty() const { return VoxelGridNothing(words_); }

VoxelSet MetByBalls(const VoxelSet& centres, const VoxelGrid& grid, double radius) {
  VoxelSet met(grid);
  const double edges = radius / grid.edge() + kVoxelGridRounding;
  const int reach = ReachAlongX(edges, 0, 0);
  const size_t words = centres.row_words();
  const uint64_t last =
      grid.size(0) % 64 == 0 ? ~uint64_t{0} : ~(~uint64_t{0} << (grid.size(0) % 64));
  // Rows widened by 0 to `reach` voxels.
  std::vector<uint64_t> wide(static_cast<size_t>(reach + 1) * words);
  std::vector<int> reaches;  // by dz and dy
  for (int dz = -reach; dz <= reach; ++dz) {
    for (int dy = -reach; dy <= reach; ++dy) reaches.push_back(ReachAlongX(edges, dy, dz));
  }
  const auto widened = [&](int by) {
    return std::span<uint64_t>(wide.data() + static_cast<size_t>(by) * words, words);
  };
  for (int z = 0; z < grid.size(2); ++z) {
    for (int y = 0; y < grid.size(1); ++y) {
      const std::span<const uint64_t> row = centres.row(y, z);
      if (VoxelGridNothing(row)) continue;
      std::copy(row.begin(), row.end(), widened(0).begin());
      for (int by = 1; by <= reach; ++by) {
        Widen(widened(by - 1), 1, widened(by));
        widened(by)[words - 1] &= last;
      }
      for (int dz = -reach; dz <= reach; ++dz) {
        if (z + dz < 0 || z + dz >= grid.size(2)) continue;
        for (int dy = -reach; dy <= reach; ++dy) {
          const int by = reaches[static_cast<size_t>((dz + reach) * (2 * reach + 1) + dy + reach)];
          if (by < 0 || y + dy < 0 || y + dy >= grid.size(1)) continue;
          const std::span<uint64_t> target = met.row(y + dy, z + dz);
          const std::span<const uint64_t> source = widened(by);
          for (size_t i = 0; i < words; ++i) target[i] |= source[i];
        }
      }
    }
  }
  return met;
}

VoxelSet Surface(const VoxelSet& set) {
  VoxelSet surface = set;
  const size_t words = set.row_words();
  for (int z = 0; z < set.size(2); ++z) {
    for (int y = 0; y < set.size(1); ++y) {
      const std::span<const uint64_t> row = set.row(y, z);
      const std::span<uint64_t> out = surface.row(y, z);
      const bool rim = y == 0 || z == 0 || y + 1 == set.size(1) || z + 1 == set.size(2);
      if (rim) continue;
      const auto above = set.row(y - 1, z), below = set.row(y + 1, z);
      const auto before = set.row(y, z - 1), behind = set.row(y, z + 1);
      for (size_t i = 0; i < words; ++i) {
        const uint64_t left = row[i] << 1 | (i > 0 ? row[i - 1] >> 63 : 0);
        const uint64_t right = row[i] >> 1 | (i + 1 < words ? row[i + 1] << 63 : 0);
        out[i] &= ~(left & right & above[i] & below[i] & before[i] & behind[i]);
      }
    }
  }
  return surface;
}

}  // namespace silhouette
