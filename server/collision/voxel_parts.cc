#include "server/collision/voxel_parts.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>

namespace silhouette {
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
