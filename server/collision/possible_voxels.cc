// SPDX-License-Identifier: Apache-2.0
#include "server/collision/possible_voxels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "server/collision/voxel_look.h"

namespace silhouette {
namespace {

constexpr int kPossibleVoxelsEdge = VoxelGrid::kBlockEdge;
constexpr uint64_t kLowestBits = 0x0101010101010101;

// Bit i of the result is bit `bit` of byte i.
unsigned BitOfBytes(uint64_t bytes, int bit) {
  return static_cast<unsigned>((bytes >> bit & kLowestBits) * 0x0102040810204080 >> 56);
}

uint64_t Gather(const uint8_t* table, const uint32_t* indices) {
  uint64_t bytes = 0;
  for (int i = 0; i < kPossibleVoxelsEdge; ++i) bytes |= uint64_t{table[indices[i]]} << (8 * i);
  return bytes;
}

// Eight voxels: which of them all views but `max_occluded_views` see as an obstacle.
class PlainVoxels {
 public:
  // `bytes`: LookTables' bits of each voxel in one more view. A view that says nothing has
  // kObstacle, and not kShown.
  void Add(uint64_t bytes) {
    occluded_ += ~bytes >> 1 & kLowestBits;
    shown_ |= bytes;
  }
  // A bit per voxel. Up to VoxelSpace::kMostViews views, no byte overflows.
  unsigned Bits(int max_occluded_views) const {
    constexpr uint64_t kAll = VoxelSpace::kMostViews;
    const uint64_t may = std::min<uint64_t>(kAll, static_cast<uint64_t>(max_occluded_views));
    const unsigned too_many = BitOfBytes(occluded_ + (kAll - may) * kLowestBits, 7);
    return ~too_many & BitOfBytes(shown_, 3);
  }

 private:
  uint64_t occluded_ = 0;  // per byte, how many views
  uint64_t shown_ = 0;
};

void CheckSizes(const VoxelSpace& space, const ObstacleImages& images,
                std::span<const std::optional<Mask>> allowed) {
  const auto views = static_cast<size_t>(space.views());
  if (images.size() != views || (!allowed.empty() && allowed.size() != views)) {
    throw std::invalid_argument("there must be one image per view");
  }
  for (size_t view = 0; view < views; ++view) {
    const MaskSize size = space.mask_size(static_cast<int>(view));
    const bool fits = (!images[view] || images[view]->size() == size) &&
                      (allowed.empty() || !allowed[view] || allowed[view]->size() == size);
    if (!fits) throw std::invalid_argument("an image has not the size of its view's masks");
  }
}

// A bit per voxel of a block, by its row along x: row y + kBlockEdge * z.
constexpr int kBlockRows = kPossibleVoxelsEdge * kPossibleVoxelsEdge;
using BlockBits = std::array<uint8_t, kBlockRows>;

bool AllEmpty(const BlockBits& bits) {
  return std::ranges::all_of(bits, [](uint8_t row) { return row == 0; });
}

// The voxels of a block.
struct BlockVoxels {
  BlockBits possible{};
  // Of these: what stays however small the obstacle, and what is allowed in all views that see it.
  BlockBits plain{};
  BlockBits allowed{};
  // Where balls may have their centres, of `possible`.
  BlockBits centres{};
};

// What the images say of blocks of voxels. Refers to the space; for one thread.
class ImagesInBlocks {
 public:
  ImagesInBlocks(const VoxelSpace& space, const ObstacleImages& images,
                 std::span<const std::optional<Mask>> allowed, int max_occluded_views)
      : space_(space), max_occluded_views_(max_occluded_views) {
    tables_.reserve(images.size());
    for (size_t view = 0; view < images.size(); ++view) {
      tables_.emplace_back(space.look(static_cast<int>(view)), images[view],
                           allowed.empty() ? std::nullopt : allowed[view]);
    }
    any_allowed_ = std::ranges::any_of(
        allowed, [](const std::optional<Mask>& mask) { return mask && !mask->Empty(); });
  }

  BlockVoxels At(size_t slot) {
    BlockVoxels block;
    for (size_t view = 0; view < tables_.size(); ++view) {
      if (!tables_[view].AnyPossible(LookOf(view).block_touched[slot])) return block;
    }
    for (size_t row = 0; row < kBlockRows; ++row) {
      LookAtRow(slot * VoxelGrid::kBlockVoxels + row * kPossibleVoxelsEdge, row, block);
    }
    return block;
  }

 private:
  const VoxelSpace::Look& LookOf(size_t view) const { return space_.look(static_cast<int>(view)); }

  void LookAtRow(size_t place, size_t row, BlockVoxels& block) {
    uint64_t bytes = ~uint64_t{0};
    PlainVoxels plain;
    for (size_t view = 0; view < tables_.size(); ++view) {
      const uint64_t in_view = Gather(tables_[view].touched(), LookOf(view).touched.data() + place);
      bytes &= in_view;
      if (BitOfBytes(bytes, 0) == 0) return;
      plain.Add(in_view);
    }
    const unsigned possible = BitOfBytes(bytes, 0);
    block.possible[row] = static_cast<uint8_t>(possible);
    block.plain[row] = static_cast<uint8_t>(possible & plain.Bits(max_occluded_views_));
    if (any_allowed_) block.allowed[row] = static_cast<uint8_t>(possible & BitOfBytes(bytes, 2));
    unsigned centres = possible;
    for (size_t view = 0; view < tables_.size() && centres != 0; ++view) {
      const uint32_t* certain = LookOf(view).certain.data() + place;
      for (unsigned left = centres; left != 0; left &= left - 1) {
        const int x = std::countr_zero(left);
        if (!tables_[view].CentrePossible(certain[x])) centres &= ~(1u << x);
      }
    }
    block.centres[row] = static_cast<uint8_t>(centres);
  }

  const VoxelSpace& space_;
  int max_occluded_views_;
  std::vector<LookTables> tables_;
  bool any_allowed_ = false;
};

// Takes the robot's body out of a block: voxels wholly inside it, and centres from which every ball
// of the least obstacle reaches into it. Asks for no distance where there is nothing to take.
class BodyInBlock {
 public:
  BodyInBlock(const VoxelSpace& space, const BodyDistance& body, const VoxelSpace::Block& block,
              BlockVoxels& voxels)
      : grid_(space.grid()),
        rho_(space.least_obstacle()),
        body_(body),
        origin_(kPossibleVoxelsEdge * Eigen::Vector3i(block.x, block.y, block.z)),
        voxels_(voxels) {}

  void Remove() { Visit({0, 0, 0, kPossibleVoxelsEdge}); }

 private:
  // The voxels [x, x + edges) and so on of the block.
  struct Cube {
    int x = 0;
    int y = 0;
    int z = 0;
    int edges = 0;

    unsigned bits() const { return ((1u << edges) - 1) << x; }
    size_t row(int i) const {
      return static_cast<size_t>(y + i % edges + kPossibleVoxelsEdge * (z + i / edges));
    }
  };
  static bool Any(const BlockBits& voxels, const Cube& cube) {
    for (int i = 0; i < cube.edges * cube.edges; ++i) {
      if ((voxels[cube.row(i)] & cube.bits()) != 0) return true;
    }
    return false;
  }
  static void Clear(BlockBits& voxels, const Cube& cube) {
    for (int i = 0; i < cube.edges * cube.edges; ++i) {
      voxels[cube.row(i)] &= static_cast<uint8_t>(~cube.bits());
    }
  }

  Eigen::Vector3d Middle(const Cube& cube) const {
    return grid_.Corner(origin_.x() + cube.x, origin_.y() + cube.y, origin_.z() + cube.z) +
           grid_.edge() * cube.edges / 2 * Eigen::Vector3d::Ones();
  }

  // All of the cube is decided by its middle, or its eighths are.
  void Visit(const Cube& cube) {
    const bool any_centre = Any(voxels_.centres, cube);
    if (!any_centre && !Any(voxels_.possible, cube)) return;
    const double distance = body_(Middle(cube));
    if (cube.edges == 1) {
      VisitVoxel(cube, distance, any_centre);
      return;
    }
    const double half_diagonal = std::sqrt(3.0) / 2 * grid_.edge();
    const double reach = cube.edges * half_diagonal;
    // No voxel of the cube is wholly below this, or less.
    const double least = distance - reach + 1.5 * half_diagonal;
    if (least >= (any_centre ? rho_ : 0)) return;
    if (distance + reach < rho_) Clear(voxels_.centres, cube);
    if (distance + reach < 0) Clear(voxels_.possible, cube);
    const int half = cube.edges / 2;
    for (int corner = 0; corner < 8; ++corner) {
      Visit({cube.x + (corner & 1) * half, cube.y + (corner >> 1 & 1) * half,
             cube.z + (corner >> 2) * half, half});
    }
  }

  void VisitVoxel(const Cube& voxel, double distance, bool centre) {
    if (WhollyBelow(0, voxel, distance)) {
      Clear(voxels_.possible, voxel);
      Clear(voxels_.centres, voxel);
    } else if (centre && WhollyBelow(rho_, voxel, distance)) {
      Clear(voxels_.centres, voxel);
    }
  }

  // Where the voxel's middle decides nothing, those of its eighths do, which are nearer to all of
  // their points.
  bool WhollyBelow(double limit, const Cube& voxel, double distance) const {
    const double half_diagonal = std::sqrt(3.0) / 2 * grid_.edge();
    if (distance + half_diagonal < limit) return true;
    const double most = limit - half_diagonal / 2;
    if (!(distance < most)) return false;
    const Eigen::Vector3d middle = Middle(voxel);
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d to((corner & 1) - 0.5, (corner >> 1 & 1) - 0.5, (corner >> 2) - 0.5);
      if (!(body_(middle + grid_.edge() / 2 * to) < most)) return false;
    }
    return true;
  }

  const VoxelGrid& grid_;
  double rho_;
  const BodyDistance& body_;
  Eigen::Vector3i origin_;
  BlockVoxels& voxels_;
};

}  // namespace

PossibleVoxels::PossibleVoxels(const VoxelSpace& space, const ObstacleImages& images,
                               const BodyDistance& body,
                               std::span<const std::optional<Mask>> allowed,
                               int max_occluded_views) {
  CheckSizes(space, images, allowed);
  if (max_occluded_views < 0) {
    throw std::invalid_argument("max_occluded_views must not be negative");
  }
  const VoxelGrid& grid = space.grid();
  VoxelSet possible(grid);
  centres = VoxelSet(grid);
  plain = VoxelSet(grid);
  VoxelSet taken(grid);
  ImagesInBlocks in_images(space, images, allowed, max_occluded_views);
  for (size_t slot = 0; slot < space.active().size(); ++slot) {
    BlockVoxels block = in_images.At(slot);
    if (AllEmpty(block.possible)) continue;
    const VoxelSpace::Block& at = space.active()[slot];
    if (body) BodyInBlock(space, body, at, block).Remove();
    for (int row = 0; row < kBlockRows; ++row) {
      const auto i = static_cast<size_t>(row);
      const unsigned bits = block.possible[i];
      if (bits == 0) continue;
      const int y = at.y * kPossibleVoxelsEdge + row % kPossibleVoxelsEdge;
      const int z = at.z * kPossibleVoxelsEdge + row / kPossibleVoxelsEdge;
      possible.InsertRowOfBlock(at.x, y, z, bits);
      plain.InsertRowOfBlock(at.x, y, z, bits & block.plain[i]);
      taken.InsertRowOfBlock(at.x, y, z,
                             bits & block.allowed[i] & space.seen().RowOfBlock(at.x, y, z));
      centres.InsertRowOfBlock(at.x, y, z, block.centres[i]);
    }
  }
  remaining = MetByBalls(centres, grid, space.least_obstacle());
  const std::span<uint64_t> words = remaining.words();
  for (size_t i = 0; i < words.size(); ++i) {
    const uint64_t reached = space.reached().words()[i] & ~taken.words()[i];
    plain.words()[i] &= reached;
    words[i] = (words[i] & possible.words()[i] & reached) | plain.words()[i];
  }
}

}  // namespace silhouette
