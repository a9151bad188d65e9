// SPDX-License-Identifier: Apache-2.0
#include "server/collision/space_distances.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>

#include "db/mask/wider_vectors.h"
#include "server/collision/obstacle_image.h"

namespace silhouette {
namespace {

// Squares of edges that lie between two voxels, `apart` places from each other along an axis.
int16_t Between(int apart) {
  const int edges = std::max(apart - 1, 0);
  return static_cast<int16_t>(edges * edges);
}

// Values of a row that are worked on together.
using Lanes [[gnu::vector_size(64), gnu::may_alias, gnu::aligned(64)]] = int16_t;
constexpr size_t kLanes = sizeof(Lanes) / sizeof(int16_t);
struct alignas(Lanes) LanesOfRow {
  std::array<int16_t, kLanes> values{};
};

// Squares by place, in rows along x that are filled up to whole Lanes.
class Squares {
 public:
  Squares(int width, int height, int depth, int16_t most)
      : width_(static_cast<size_t>(width)),
        height_(static_cast<size_t>(height)),
        depth_(depth),
        lanes_((width_ + kLanes - 1) / kLanes),
        values_(lanes_ * height_ * static_cast<size_t>(depth)) {
    for (int z = 0; z < depth; ++z) {
      for (int y = 0; y < height; ++y) std::ranges::fill(Row(y, z), most);
    }
  }

  std::span<int16_t> Row(int y, int z) {
    return {reinterpret_cast<int16_t*>(&First(y, z)), width_};
  }

  // Rows of one y or z, one after another.
  struct Line {
    LanesOfRow* first = nullptr;
    int rows = 0;
    size_t apart = 0;  // of rows, in Lanes
    size_t lanes = 0;  // of a row
  };
  Line AlongY(int z) { return {&First(0, z), static_cast<int>(height_), lanes_, lanes_}; }
  Line AlongZ(int y) { return {&First(y, 0), depth_, lanes_ * height_, lanes_}; }

 private:
  LanesOfRow& First(int y, int z) {
    return values_[(static_cast<size_t>(z) * height_ + static_cast<size_t>(y)) * lanes_];
  }

  size_t width_;
  size_t height_;
  int depth_;
  size_t lanes_;  // of a row
  std::vector<LanesOfRow> values_;
};

// Each row of `to` = the least of all rows of `from`, value by value, each with the square between
// the two; row 0 of `to` is at the place of row `first` of `from`. Values are at most
// Between(reach).
SILHOUETTE_WIDER_VECTORS
void LeastOfRows(const Squares::Line& from, int first, int reach, const Squares::Line& to) {
  constexpr int kBetweenLooks = 4;
  for (size_t x = 0; x < from.lanes; ++x) {
    const auto* const rows = reinterpret_cast<const Lanes*>(from.first + x);
    Lanes least_of_all = rows[0];
    for (int row = 1; row < from.rows; ++row) {
      const Lanes& other = rows[static_cast<size_t>(row) * from.apart];
      least_of_all = other < least_of_all ? other : least_of_all;
    }
    for (int row = 0; row < to.rows; ++row) {
      const int at = first + row;
      const Lanes* before = rows + static_cast<size_t>(at) * from.apart;
      const Lanes* behind = before;
      Lanes least = *before;
      for (int apart = 1; apart < reach; ++apart) {
        const int16_t between = Between(apart);
        if (apart % kBetweenLooks == 1) {  // may rows from here on be less?
          const Lanes more = least > least_of_all + between;
          uint64_t any = 0;
          for (const uint64_t word : std::bit_cast<std::array<uint64_t, sizeof(Lanes) / 8>>(more)) {
            any |= word;
          }
          if (any == 0) break;
        }
        if (apart <= at) {
          before -= from.apart;
          const Lanes square = *before + between;
          least = square < least ? square : least;
        }
        if (apart < from.rows - at) {
          behind += from.apart;
          const Lanes square = *behind + between;
          least = square < least ? square : least;
        }
      }
      reinterpret_cast<Lanes*>(to.first + x)[static_cast<size_t>(row) * to.apart] = least;
    }
  }
}

// Squares by how many voxels apart, and the same backwards.
struct NearSquares {
  NearSquares(int places, int16_t most) {
    for (int apart = 0; apart <= places; ++apart) {
      // Farther ones do not fit, and are above `most`.
      onwards.push_back(apart > 182 ? most : std::min(most, Between(apart)));
    }
    backwards.assign(onwards.rbegin(), onwards.rend());
  }
  std::vector<int16_t> onwards;
  std::vector<int16_t> backwards;
};

// Of one row that has a voxel: squares along it. `near`: as long.
void AlongRow(std::span<const uint64_t> row, const NearSquares& near, std::span<int16_t> squares) {
  const int width = static_cast<int>(squares.size());
  const auto copy = [&](const std::vector<int16_t>& from, int at, int first, int last) {
    std::copy_n(from.begin() + at, last - first, squares.begin() + first);
  };
  int after = 0;  // place after the last voxel
  bool any = false;
  for (size_t word = 0; word < row.size(); ++word) {
    for (uint64_t left = row[word]; left != 0; left &= left - 1) {
      const int x = static_cast<int>(64 * word) + std::countr_zero(left);
      const int middle = any ? (after + x) / 2 : 0;
      if (any) copy(near.onwards, 1, after, middle);
      copy(near.backwards, width - x + middle, middle, x);
      squares[static_cast<size_t>(x)] = 0;
      after = x + 1;
      any = true;
    }
  }
  copy(near.onwards, 1, after, width);
}

}  // namespace

SpaceDistances::SpaceDistances(const std::vector<VoxelsOfGrid>& sets, double range,
                               const std::optional<Eigen::AlignedBox3d>& known,
                               const std::optional<Eigen::AlignedBox3d>& asked)
    : grid_(sets.empty() ? throw std::invalid_argument("there is no set of voxels")
                         : sets.front().grid),
      range_(range),
      known_(known) {
  for (const VoxelsOfGrid& voxels : sets) {
    for (int axis = 0; axis < 3; ++axis) {
      if (voxels.set.size(axis) != voxels.grid.size(axis)) {
        throw std::invalid_argument("the voxels are not of the grid");
      }
    }
  }
  const double edges = range / grid_.edge();
  if (!(edges > 0 && edges <= 127)) {
    throw std::invalid_argument("a range of distances is positive, and at most 127 edges");
  }
  PlaceMap(asked ? grid_.box().intersection(*asked) : grid_.box());
  VoxelSet all = sets.front().set;
  for (const VoxelsOfGrid& voxels : sets) {
    AddBlocks(voxels);
    if (&voxels != &sets.front()) AddTouched(voxels.set, voxels.grid, grid_, all);
  }
  FillMap(all);
}

void SpaceDistances::AddBlocks(const VoxelsOfGrid& voxels) {
  constexpr int kEdge = VoxelGrid::kBlockEdge;
  const VoxelGrid& grid = voxels.grid;
  const std::vector<bool> with_voxels = BlocksWithVoxels(voxels.set);
  for (int bz = 0; bz < grid.blocks(2); ++bz) {
    for (int by = 0; by < grid.blocks(1); ++by) {
      for (int bx = 0; bx < grid.blocks(0); ++bx) {
        if (!with_voxels[static_cast<size_t>(grid.BlockAt(bx, by, bz))]) continue;
        Block block{.lower = grid.Corner(kEdge * bx, kEdge * by, kEdge * bz), .edge = grid.edge()};
        for (int row = 0; row < kEdge * kEdge; ++row) {
          const int y = kEdge * by + row % kEdge;
          const int z = kEdge * bz + row / kEdge;
          const auto bits = static_cast<uint8_t>(voxels.set.RowOfBlock(bx, y, z));
          if (bits == 0) continue;
          block.rows[static_cast<size_t>(row)] = bits;
          block.voxels.extend(grid.Box(kEdge * bx + std::countr_zero(bits), y, z));
          block.voxels.extend(grid.Box(kEdge * bx + 7 - std::countl_zero(bits), y, z));
        }
        blocks_.push_back(block);
      }
    }
  }
}

void SpaceDistances::PlaceMap(const Eigen::AlignedBox3d& asked) {
  if (asked.isEmpty()) throw std::invalid_argument("distances are asked for beyond the grid");
  for (int axis = 0; axis < 3; ++axis) {
    const auto place = [&](double at, int last) {
      return std::clamp(static_cast<int>((at - grid_.lower()[axis]) / grid_.edge()), 0, last);
    };
    first_[axis] = place(asked.min()[axis], grid_.size(axis) - 1);
    size_[axis] = place(asked.max()[axis], grid_.size(axis) - 1) - first_[axis] + 1;
  }
}

void SpaceDistances::FillMap(const VoxelSet& voxels) {
  const double edges = range_ / grid_.edge();
  const int reach = static_cast<int>(std::ceil(edges)) + 1;  // places apart that count
  const int16_t most = Between(reach);
  // Squares along x, of the rows of the whole grid.
  Squares along_x(size_.x(), grid_.size(1), grid_.size(2), most);
  std::vector<int16_t> whole_row(static_cast<size_t>(grid_.size(0)));
  const NearSquares near(grid_.size(0), most);
  for (int z = 0; z < grid_.size(2); ++z) {
    for (int y = 0; y < grid_.size(1); ++y) {
      const auto row = voxels.row(y, z);
      if (NothingSet(row)) continue;
      AlongRow(row, near, whole_row);
      std::copy_n(whole_row.begin() + first_.x(), size_.x(), along_x.Row(y, z).begin());
    }
  }
  Squares along_y(size_.x(), size_.y(), grid_.size(2), most);
  for (int z = 0; z < grid_.size(2); ++z) {
    LeastOfRows(along_x.AlongY(z), first_.y(), reach, along_y.AlongY(z));
  }
  Squares along_z(size_.x(), size_.y(), size_.z(), most);
  for (int y = 0; y < size_.y(); ++y) {
    LeastOfRows(along_y.AlongZ(y), first_.z(), reach, along_z.AlongZ(y));
  }
  for (int z = 0; z < size_.z(); ++z) {
    for (int y = 0; y < size_.y(); ++y) {
      const std::span<const int16_t> row = along_z.Row(y, z);
      squares_.insert(squares_.end(), row.begin(), row.end());
    }
  }
}

double SpaceDistances::ToUnknown(const Eigen::Vector3d& point) const {
  if (!known_) return range_;
  const double inside = (point - known_->min()).cwiseMin(known_->max() - point).minCoeff();
  return std::clamp(inside, 0.0, range_);
}

double SpaceDistances::AtLeast(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d place = (point - grid_.lower()) / grid_.edge();
  Eigen::Vector3i voxel;  // of the map, the nearest
  Eigen::Vector3d way;    // to it, edges
  for (int axis = 0; axis < 3; ++axis) {
    if (!(place[axis] >= 0 && place[axis] < grid_.size(axis))) return 0;
    voxel[axis] = std::clamp(static_cast<int>(place[axis]) - first_[axis], 0, size_[axis] - 1);
    const int first = first_[axis] + voxel[axis];
    way[axis] = std::max({0.0, first - place[axis], place[axis] - first - 1});
  }
  const auto number = (static_cast<size_t>(voxel.z()) * static_cast<size_t>(size_.y()) +
                       static_cast<size_t>(voxel.y())) *
                          static_cast<size_t>(size_.x()) +
                      static_cast<size_t>(voxel.x());
  const double edges = std::sqrt(static_cast<double>(squares_[number])) - way.norm();
  return std::clamp(edges * grid_.edge(), 0.0, ToUnknown(point));
}

void SpaceDistances::Measure(const Block& block, const Eigen::Vector3d& point, double& square) {
  constexpr int kEdge = VoxelGrid::kBlockEdge;
  const Eigen::Vector3d at = (point - block.lower) / block.edge;
  const double scale = block.edge * block.edge;
  const auto beside = [](double x, int place) {  // edges from a voxel, along one axis
    return std::max({0.0, place - x, x - place - 1});
  };
  const int x = std::clamp(static_cast<int>(std::floor(at.x())), 0, kEdge - 1);
  const unsigned up_to_x = (2u << x) - 1;
  for (int z = 0; z < kEdge; ++z) {
    const double dz = beside(at.z(), z);
    if (scale * dz * dz >= square) continue;
    for (int y = 0; y < kEdge; ++y) {
      const unsigned bits = block.rows[static_cast<size_t>(z * kEdge + y)];
      if (bits == 0) continue;
      const double dy = beside(at.y(), y);
      // The nearest on either side, and its own place.
      double dx = std::numeric_limits<double>::infinity();
      if (const unsigned low = bits & up_to_x; low != 0) {
        dx = beside(at.x(), static_cast<int>(std::bit_width(low)) - 1);
      }
      if (const unsigned high = bits & ~(up_to_x >> 1); high != 0) {
        dx = std::min(dx, beside(at.x(), std::countr_zero(high)));
      }
      square = std::min(square, scale * (dx * dx + dy * dy + dz * dz));
    }
  }
}

double SpaceDistances::Distance(const Eigen::Vector3d& point, double at_most) const {
  for (int axis = 0; axis < 3; ++axis) {
    const double place = (point[axis] - grid_.lower()[axis]) / grid_.edge();
    if (!(place >= 0 && place < grid_.size(axis))) return 0;
  }
  double square = std::pow(std::clamp(at_most, 0.0, ToUnknown(point)), 2);
  // The block whose voxels begin nearest first: of most others none is as near.
  const Block* nearest = nullptr;
  double begins = square;
  for (const Block& block : blocks_) {
    const double to_block = block.voxels.squaredExteriorDistance(point);
    if (to_block >= begins) continue;
    begins = to_block;
    nearest = &block;
  }
  if (nearest == nullptr) return std::sqrt(square);
  Measure(*nearest, point, square);
  for (const Block& block : blocks_) {
    if (&block != nearest && block.voxels.squaredExteriorDistance(point) < square) {
      Measure(block, point, square);
    }
  }
  return std::sqrt(square);
}

}  // namespace silhouette
