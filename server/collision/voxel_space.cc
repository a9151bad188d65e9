// SPDX-License-Identifier: Apache-2.0
#include "server/collision/voxel_space.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <stdexcept>
#include <string>

#include "server/collision/voxel_look.h"

namespace silhouette {
namespace {

constexpr int kVoxelSpaceEdge = VoxelGrid::kBlockEdge;
constexpr double kTouching = 1e-6;  // share of an edge

Eigen::AlignedBox3d WithRoom(const Eigen::AlignedBox3d& box, double room) {
  const Eigen::Vector3d all_sides = Eigen::Vector3d::Constant(room);
  return {box.min() - all_sides, box.max() + all_sides};
}

double CheckedLength(double length, const char* what) {
  if (length > 0 && std::isfinite(length)) return length;
  throw std::invalid_argument(std::string(what) + " must be positive");
}

// Voxels around the workspace: how far the centre of a ball that meets it may be away.
VoxelGrid GridOf(const Eigen::AlignedBox3d& workspace, double rho, std::optional<double> edge) {
  CheckedLength(rho, "the least obstacle");
  const double length = CheckedLength(edge.value_or(rho / 3), "the edge of a voxel");
  const double room = std::ceil(rho / length) * length;
  return VoxelGrid(WithRoom(workspace, room), length);
}

bool AnySet(const Mask& mask, const PixelRectangle& pixels) {
  return AnyCommon(mask.words(), mask.words(), mask.width(), pixels);
}

// The pixels of `ground` that are joined to `mask`, on which they border.
Mask JoinedTo(const Mask& mask, const Mask& ground) {
  constexpr double kBeside = 1;  // pixels
  Mask joined = Grown(mask, kBeside) & ground;
  while (true) {
    Mask next = Grown(joined, kBeside) & ground;
    if (next == joined) return joined;
    joined = std::move(next);
  }
}

// Per view, whether the robot may be where the view does not look; not where that is not known.
std::vector<bool> LeavesOf(std::span<const VoxelView> views) {
  std::vector<bool> leaves;
  for (const VoxelView& view : views) {
    leaves.push_back(view.swept.size() != MaskSize{} &&
                     MayReachBeyond(view.swept.words(), view.swept.size()));
  }
  return leaves;
}

}  // namespace

VoxelSpace::VoxelSpace(const Eigen::AlignedBox3d& workspace, double least_obstacle,
                       std::vector<VoxelView> views, std::optional<double> edge)
    : least_obstacle_(least_obstacle), grid_(GridOf(workspace, least_obstacle, edge)) {
  if (views.empty() || views.size() > kMostViews) {
    throw std::invalid_argument("there must be 1 to " + std::to_string(kMostViews) + " views");
  }
  for (const VoxelView& view : views) {
    if (!view.mask_size.valid()) throw std::invalid_argument("a view has no mask size");
    if (!(view.margin.minCoeff() >= 0) || !view.margin.allFinite()) {
      throw std::invalid_argument("a view's margin must not be negative");
    }
    for (const Mask* pixels : {&view.swept, &view.permanent, &view.ignored}) {
      if (pixels->size() != MaskSize{} && pixels->size() != view.mask_size) {
        throw std::invalid_argument("the swept pixels of a view have not the size of its masks");
      }
    }
  }
  looks_.resize(views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    VoxelView& view = views[i];
    looks_[i].mask_size = view.mask_size;
    looks_[i].ignored = view.ignored;
    if (view.ignored.Empty()) continue;
    const bool swept_known = view.swept.size() != MaskSize{};
    // A robot of one piece gets from where it is seen to the rim through ignored pixels alone.
    const Mask through = swept_known ? JoinedTo(view.swept, view.ignored) : view.ignored;
    looks_[i].leaves_unseen = !through.Empty() && MayReachBeyond(through.words(), view.mask_size);
    if (swept_known) view.swept = view.swept | view.ignored;
  }
  // A voxel that only touches the workspace from outside has no part in it.
  const Eigen::AlignedBox3d inner = WithRoom(workspace, -kTouching * grid_.edge());
  FindActiveBlocks(views, inner);
  std::vector<std::future<void>> looking;
  for (size_t view = 0; view < views.size(); ++view) {
    looking.push_back(std::async(std::launch::async, [&, view] {
      VoxelLooker looker(views[view], grid_, least_obstacle_, looks_[view]);
      for (const Block& block : active_) looker.Append(block);
    }));
  }
  for (std::future<void>& looked : looking) looked.get();
  FindReached(views, inner);
}

void VoxelSpace::FindActiveBlocks(std::span<const VoxelView> views,
                                  const Eigen::AlignedBox3d& workspace) {
  // Blocks as voxels: those that may hold a reached voxel, and those around them.
  const VoxelGrid blocks(grid_.box(), kVoxelSpaceEdge * grid_.edge());
  VoxelSet reached(blocks);
  std::vector<VoxelLooker> lookers;
  for (size_t view = 0; view < views.size(); ++view) {
    lookers.emplace_back(views[view], grid_, least_obstacle_, looks_[view]);
  }
  const std::vector<bool> leaves = LeavesOf(views);
  const auto may_be_reached = [&](const Block& block) {
    if (!workspace.intersects(BoxOf(block))) return false;
    for (size_t view = 0; view < views.size(); ++view) {
      const Mask& swept = views[view].swept;
      if (swept.size() == MaskSize{}) continue;
      const PixelRectangle pixels = lookers[view].BlockRectangle(block);
      if (!AnySet(swept, pixels) && (pixels.whole || !leaves[view])) return false;
    }
    return true;
  };
  for (int z = 0; z < grid_.blocks(2); ++z) {
    for (int y = 0; y < grid_.blocks(1); ++y) {
      for (int x = 0; x < grid_.blocks(0); ++x) {
        if (may_be_reached({x, y, z})) reached.Insert(x, y, z);
      }
    }
  }
  const VoxelSet active = MetByBalls(reached, blocks, least_obstacle_);
  slots_.assign(static_cast<size_t>(grid_.blocks()), -1);
  for (int z = 0; z < grid_.blocks(2); ++z) {
    for (int y = 0; y < grid_.blocks(1); ++y) {
      for (int x = 0; x < grid_.blocks(0); ++x) {
        if (!active.at(x, y, z)) continue;
        slots_[static_cast<size_t>(grid_.BlockAt(x, y, z))] = static_cast<int32_t>(active_.size());
        active_.push_back({x, y, z});
      }
    }
  }
}

void VoxelSpace::FindReached(std::span<const VoxelView> views,
                             const Eigen::AlignedBox3d& workspace) {
  reached_ = VoxelSet(grid_);
  seen_ = VoxelSet(grid_);
  always_covered_.assign(views.size(), VoxelSet(grid_));
  const std::vector<bool> leaves = LeavesOf(views);
  const auto visit = [&](int x, int y, int z, size_t place) {
    bool reached = workspace.intersects(grid_.Box(x, y, z));
    for (size_t view = 0; view < views.size(); ++view) {
      const PixelRectangle pixels = looks_[view].Rectangle(looks_[view].touched[place]);
      if (pixels.whole) seen_.Insert(x, y, z);
      const Mask& permanent = views[view].permanent;
      if (looks_[view].Ignores(pixels) ||
          (permanent.size() != MaskSize{} && AnySet(permanent, pixels))) {
        always_covered_[view].Insert(x, y, z);
      }
      const Mask& swept = views[view].swept;
      if (!reached || swept.size() == MaskSize{}) continue;
      reached = AnySet(swept, pixels) || (!pixels.whole && leaves[view]);
    }
    if (reached) reached_.Insert(x, y, z);
  };
  size_t place = 0;
  for (const Block& block : active_) {
    for (int i = 0; i < VoxelGrid::kBlockVoxels; ++i, ++place) {
      visit(block.x * kVoxelSpaceEdge + i % kVoxelSpaceEdge,
            block.y * kVoxelSpaceEdge + i / kVoxelSpaceEdge % kVoxelSpaceEdge,
            block.z * kVoxelSpaceEdge + i / (kVoxelSpaceEdge * kVoxelSpaceEdge), place);
    }
  }
}

Eigen::AlignedBox3d VoxelSpace::BoxOf(const Block& block) const {
  const int x = kVoxelSpaceEdge * block.x;
  const int y = kVoxelSpaceEdge * block.y;
  const int z = kVoxelSpaceEdge * block.z;
  return {grid_.Corner(x, y, z),
          grid_.Corner(x + kVoxelSpaceEdge, y + kVoxelSpaceEdge, z + kVoxelSpaceEdge)};
}

PixelRectangle VoxelSpace::Look::Rectangle(uint32_t touched_index) const {
  if (touched_index == 0) return {};
  const auto pixels = static_cast<uint32_t>(mask_size.pixels());
  const RectangleKind& kind = kinds[(touched_index - 1) / pixels];
  const int pixel = static_cast<int>((touched_index - 1) % pixels);
  return {pixel % mask_size.width, pixel / mask_size.width, kind.width, kind.height, kind.whole};
}

std::optional<size_t> VoxelSpace::PlaceOf(int x, int y, int z) const {
  const int32_t slot = slots_[static_cast<size_t>(
      grid_.BlockAt(x / kVoxelSpaceEdge, y / kVoxelSpaceEdge, z / kVoxelSpaceEdge))];
  if (slot < 0) return std::nullopt;
  return static_cast<size_t>(slot) * VoxelGrid::kBlockVoxels +
         static_cast<size_t>((z % kVoxelSpaceEdge * kVoxelSpaceEdge + y % kVoxelSpaceEdge) *
                                 kVoxelSpaceEdge +
                             x % kVoxelSpaceEdge);
}

PixelRectangle VoxelSpace::Touched(int view, int x, int y, int z) const {
  const std::optional<size_t> place = PlaceOf(x, y, z);
  if (!place) return {};
  return look(view).Rectangle(look(view).touched[*place]);
}

}  // namespace silhouette
