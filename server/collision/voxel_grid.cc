// SPDX-License-Identifier: Apache-2.0
#include "server/collision/voxel_grid.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>

#include "server/collision/obstacle_image.h"

namespace silhouette {

namespace {

constexpr double kVoxelGridRounding = 1e-9;  // share of an edge

// `row` and its neighbours on either side; words, bit 0 first.
void Widen(std::span<const uint64_t> row, std::span<uint64_t> wide) {
  uint64_t from_left = 0;
  for (size_t i = 0; i < row.size(); ++i) {
    const uint64_t word = row[i];
    const uint64_t from_right = i + 1 < row.size() ? row[i + 1] << 63 : 0;
    wide[i] = word | word << 1 | from_left | word >> 1 | from_right;
    from_left = word >> 63;
  }
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

bool VoxelSet::Empty() const { return NothingSet(words_); }

void VoxelSet::InsertRun(int first, int last, int y, int z) {
  const std::span<uint64_t> words = row(y, z);
  for (int x = first; x <= last;) {
    const int in_word = std::min(last - x + 1, 64 - x % 64);
    words[static_cast<size_t>(x) / 64] |= ~uint64_t{0} >> (64 - in_word) << (x % 64);
    x += in_word;
  }
}

std::vector<bool> BlocksWithVoxels(const VoxelSet& set) {
  constexpr int kEdge = VoxelGrid::kBlockEdge;
  std::vector<bool> blocks;
  std::vector<uint64_t> any(set.row_words());
  for (int z = 0; z < set.size(2); z += kEdge) {
    for (int y = 0; y < set.size(1); y += kEdge) {
      std::ranges::fill(any, 0);
      for (int row = 0; row < kEdge * kEdge; ++row) {
        const std::span<const uint64_t> words = set.row(y + row % kEdge, z + row / kEdge);
        for (size_t i = 0; i < any.size(); ++i) any[i] |= words[i];
      }
      for (size_t x = 0; x < static_cast<size_t>(set.size(0) / kEdge); ++x) {
        blocks.push_back((any[x / 8] >> (8 * (x % 8)) & 0xff) != 0);
      }
    }
  }
  return blocks;
}

std::pair<int, int> OtherGrid::Touched(int axis, int place) const {
  const double lower = (from_.lower()[axis] - to_.lower()[axis]) / to_.edge();
  const double edge = from_.edge() / to_.edge();
  const auto at = [&](double value) {
    return std::clamp(static_cast<int>(std::floor(value)), 0, to_.size(axis) - 1);
  };
  return {at(lower + place * edge - kVoxelGridRounding),
          at(lower + (place + 1) * edge + kVoxelGridRounding)};
}

void AddTouched(const VoxelSet& voxels, const VoxelGrid& from, const VoxelGrid& to, VoxelSet& set) {
  const OtherGrid other(from, to);
  for (int z = 0; z < from.size(2); ++z) {
    const auto [first_z, last_z] = other.Touched(2, z);
    for (int y = 0; y < from.size(1); ++y) {
      const auto row = voxels.row(y, z);
      if (std::ranges::all_of(row, [](uint64_t word) { return word == 0; })) continue;
      const auto [first_y, last_y] = other.Touched(1, y);
      for (int x = 0; x < from.size(0); ++x) {
        if (!voxels.at(x, y, z)) continue;
        const int first_x = other.Touched(0, x).first;
        while (x + 1 < from.size(0) && voxels.at(x + 1, y, z)) ++x;
        const int last_x = other.Touched(0, x).second;
        for (int at_z = first_z; at_z <= last_z; ++at_z) {
          for (int at_y = first_y; at_y <= last_y; ++at_y) {
            set.InsertRun(first_x, last_x, at_y, at_z);
          }
        }
      }
    }
  }
}

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
      if (NothingSet(row)) continue;
      std::copy(row.begin(), row.end(), widened(0).begin());
      for (int by = 1; by <= reach; ++by) {
        Widen(widened(by - 1), widened(by));
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

namespace {

// Sets of runs that can be joined.
class Joined {
 public:
  int Add() {
    parents_.push_back(static_cast<int>(parents_.size()));
    return parents_.back();
  }
  int Root(int i) {
    while (At(i) != i) i = At(i) = At(At(i));
    return i;
  }
  void Join(int a, int b) { At(std::max(Root(a), Root(b))) = std::min(Root(a), Root(b)); }

 private:
  int& At(int i) { return parents_[static_cast<size_t>(i)]; }
  std::vector<int> parents_;
};

// Calls run(first, last) for all runs of a row.
template <typename Run>
void ForRuns(std::span<const uint64_t> row, Run run) {
  const int end = static_cast<int>(row.size()) * 64;
  // The first place from `x` on whose bit is `wanted`.
  const auto find = [&](int x, bool wanted) {
    while (x < end) {
      const uint64_t word = row[static_cast<size_t>(x) / 64];
      const uint64_t left = (wanted ? word : ~word) >> (x % 64);
      if (left != 0) return x + std::countr_zero(left);
      x = (x / 64 + 1) * 64;
    }
    return end;
  };
  for (int first = find(0, true); first < end;) {
    const int after = find(first, false);
    run(first, after - 1);
    first = find(after, true);
  }
}

}  // namespace

std::vector<VoxelRun> ConnectedParts(const VoxelSet& set, int most) {
  std::vector<VoxelRun> runs;
  Joined joined;
  const auto rows = static_cast<size_t>(set.size(1)) * static_cast<size_t>(set.size(2));
  std::vector<size_t> row_starts(rows + 1, 0);  // of a row's runs
  const auto join_with_row = [&](const VoxelRun& run, int number, int y, int z) {
    if (y < 0 || z < 0 || y >= set.size(1)) return;
    const auto row = static_cast<size_t>(z * set.size(1) + y);
    for (size_t i = row_starts[row]; i < row_starts[row + 1]; ++i) {
      if (runs[i].first <= run.last + 1 && runs[i].last >= run.first - 1) {
        joined.Join(number, static_cast<int>(i));
      }
    }
  };
  for (int z = 0; z < set.size(2); ++z) {
    for (int y = 0; y < set.size(1); ++y) {
      ForRuns(set.row(y, z), [&](int first, int last) {
        const VoxelRun run{y, z, first, last, 0};
        const int number = joined.Add();
        join_with_row(run, number, y - 1, z);
        for (int dy = -1; dy <= 1; ++dy) join_with_row(run, number, y + dy, z - 1);
        runs.push_back(run);
      });
      row_starts[static_cast<size_t>(z * set.size(1) + y) + 1] = runs.size();
    }
  }
  // Number the parts by their size.
  std::vector<int64_t> voxels(runs.size(), 0);
  for (size_t i = 0; i < runs.size(); ++i) {
    voxels[static_cast<size_t>(joined.Root(static_cast<int>(i)))] +=
        runs[i].last - runs[i].first + 1;
  }
  std::vector<size_t> roots;
  for (size_t i = 0; i < runs.size(); ++i) {
    if (voxels[i] > 0) roots.push_back(i);
  }
  std::stable_sort(roots.begin(), roots.end(),
                   [&](size_t a, size_t b) { return voxels[a] > voxels[b]; });
  std::vector<int> parts(runs.size(), 0);
  for (size_t i = 0; i < roots.size(); ++i) {
    parts[roots[i]] = std::min(static_cast<int>(i), most - 1);
  }
  for (size_t i = 0; i < runs.size(); ++i) {
    runs[i].part = parts[static_cast<size_t>(joined.Root(static_cast<int>(i)))];
  }
  return runs;
}

void VoxelPart::Add(const VoxelRun& run) {
  runs.push_back(run);
  low = {std::min(low[0], run.first), std::min(low[1], run.y), std::min(low[2], run.z)};
  high = {std::max(high[0], run.last), std::max(high[1], run.y), std::max(high[2], run.z)};
}

int VoxelPart::Length() const {
  if (runs.empty()) return 0;
  return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}) + 1;
}

std::vector<VoxelPart> PartsOf(const std::vector<VoxelRun>& runs) {
  std::vector<VoxelPart> parts;
  for (const VoxelRun& run : runs) {
    const auto part = static_cast<size_t>(run.part);
    if (parts.size() <= part) parts.resize(part + 1);
    parts[part].Add(run);
  }
  return parts;
}

std::pair<VoxelPart, VoxelPart> Halves(const VoxelPart& part) {
  const int length = part.Length();
  size_t axis = 0;
  while (part.high[axis] - part.low[axis] + 1 < length) ++axis;
  const int middle = part.low[axis] + length / 2;  // the first of the upper half
  std::pair<VoxelPart, VoxelPart> halves;
  for (VoxelRun run : part.runs) {
    if (axis != 0) {
      ((axis == 1 ? run.y : run.z) < middle ? halves.first : halves.second).Add(run);
      continue;
    }
    VoxelRun upper = run;
    run.last = std::min(run.last, middle - 1);
    upper.first = std::max(upper.first, middle);
    if (run.first <= run.last) halves.first.Add(run);
    if (upper.first <= upper.last) halves.second.Add(upper);
  }
  return halves;
}

}  // namespace silhouette
