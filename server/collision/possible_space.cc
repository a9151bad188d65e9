// SPDX-License-Identifier: Apache-2.0
#include "server/collision/possible_space.h"

#include <algorithm>
#include <bit>

#include "server/collision/voxel_grid.h"

namespace silhouette {
namespace {

constexpr int kPossibleSpaceEdge = VoxelGrid::kBlockEdge;
// Parts no longer than this, in voxels, are not split.
constexpr int kShortestPart = 3;

Mask Rim(MaskSize size) {
  return Mask::FromPredicate(size, [size](int x, int y) {
    return x == 0 || y == 0 || x + 1 == size.width || y + 1 == size.height;
  });
}

// Sets pixels of an image.
void SetPixels(std::span<uint64_t> words, int image_width, const PixelRectangle& pixels) {
  AnyWord(image_width, pixels, [&](size_t word, uint64_t wanted) {
    words[word] |= wanted;
    return false;
  });
}

// The planes of one part, while they are drawn.
class PartPlanes {
 public:
  explicit PartPlanes(const VoxelSpace& space) : space_(space) {
    for (int view = 0; view < space.views(); ++view) {
      words_.emplace_back(space.mask_size(view).words(), 0);
    }
    beyond_.assign(words_.size(), false);
  }

  void Add(size_t place) {
    for (size_t view = 0; view < words_.size(); ++view) {
      const VoxelSpace::Look& look = space_.look(static_cast<int>(view));
      const PixelRectangle pixels = look.Rectangle(look.touched[place]);
      if (!pixels.whole) beyond_[view] = true;
      SetPixels(words_[view], look.mask_size.width, pixels);
    }
  }

  PossibleSpace::Part Cut(const CollisionImages& possible_pixels) const {
    PossibleSpace::Part part{CollisionImages(words_.size()), beyond_};
    for (size_t view = 0; view < words_.size(); ++view) {
      if (!possible_pixels[view]) continue;
      const MaskSize size = possible_pixels[view]->size();
      const VoxelSpace::Look& look = space_.look(static_cast<int>(view));
      if (beyond_[view] && look.leaves_unseen) continue;
      if (look.ignored.size() == size && Intersects(look.ignored.words(), words_[view])) continue;
      part.planes[view] = Mask::FromWords(size, words_[view]) & *possible_pixels[view];
      if (beyond_[view]) part.planes[view] = *part.planes[view] | Rim(size);
    }
    return part;
  }

 private:
  const VoxelSpace& space_;
  std::vector<std::vector<uint64_t>> words_;
  std::vector<bool> beyond_;
};

// Which voxels a robot is seen with.
class RobotQuery {
 public:
  // `pixels`: those in which it is looked for. `may_miss`: the number of views in which it need not
  // be seen.
  RobotQuery(const VoxelSpace& space, const CollisionImages& pixels,
             std::span<const MaskWords> robot, int may_miss)
      : space_(space), pixels_(pixels), robot_(robot), may_miss_(may_miss) {}

  bool MeetsBlock(size_t slot) const {
    return Meets([&](const VoxelSpace::Look& look) { return look.block_touched[slot]; });
  }
  bool MeetsVoxel(size_t place) const {
    return Meets([&](const VoxelSpace::Look& look) { return look.Rectangle(look.touched[place]); });
  }

 private:
  template <typename PixelsIn>
  bool Meets(PixelsIn pixels_in) const {
    int missed = 0;
    for (size_t view = 0; view < robot_.size(); ++view) {
      const std::optional<Mask>& wanted = pixels_[view];
      if (!wanted) continue;
      const PixelRectangle pixels = pixels_in(space_.look(static_cast<int>(view)));
      const MaskSize size = wanted->size();
      // Where the robot meets an obstacle, the pixel is the robot's and not background.
      if (AnyCommon(robot_[view], wanted->words(), size.width, pixels)) continue;
      if (space_.look(static_cast<int>(view)).Ignores(pixels)) continue;
      if (!pixels.whole && MayReachBeyond(robot_[view], size)) continue;
      if (++missed > may_miss_) return false;
    }
    return true;
  }

  const VoxelSpace& space_;
  const CollisionImages& pixels_;
  std::span<const MaskWords> robot_;
  int may_miss_;
};

}  // namespace

PossibleSpace::PossibleSpace(const VoxelSpace& space, const ObstacleImages& images,
                             const BodyDistance& body, std::span<const std::optional<Mask>> allowed,
                             int max_occluded_views)
    : space_(space),
      voxels_(space, images, body, allowed, max_occluded_views),
      max_occluded_views_(max_occluded_views) {
  plain_blocks_ = BlocksOf(voxels_.plain);
  centre_blocks_ = BlocksOf(voxels_.centres);
  FindParts(images);
}

void PossibleSpace::FindParts(const ObstacleImages& images) {
  const auto views = static_cast<size_t>(space_.views());
  possible_pixels_.resize(views);
  obstacle_pixels_.resize(views);
  for (size_t view = 0; view < views; ++view) {
    if (!images[view]) continue;
    possible_pixels_[view] = ~images[view]->Background();
    obstacle_pixels_[view] = images[view]->obstacle();
  }
  // Voxels inside a part are seen where its surface is, or where it is cut off.
  const VoxelSet surface = Surface(voxels_.remaining);
  always_met_ = VoxelSet(space_.grid());
  std::vector<VoxelPart> parts = PartsOf(ConnectedParts(voxels_.remaining, kMostParts / 4));
  for (size_t i = 0; i < parts.size(); ++i) {
    while (AlwaysMet(parts[i]) && parts[i].Length() > kShortestPart && parts.size() < kMostParts) {
      auto [lower, upper] = Halves(parts[i]);
      parts[i] = std::move(lower);
      parts.push_back(std::move(upper));
    }
    if (AlwaysMet(parts[i])) {
      for (const VoxelRun& run : parts[i].runs)
        always_met_.InsertRun(run.first, run.last, run.y, run.z);
    } else {
      parts_.push_back(Drawn(parts[i], surface));
    }
  }
  remaining_blocks_ = BlocksOf(voxels_.remaining);
  always_met_blocks_ = BlocksOf(always_met_);
}

std::vector<int> PossibleSpace::BlocksOf(const VoxelSet& voxels) const {
  const std::vector<bool> with_voxels = BlocksWithVoxels(voxels);
  std::vector<int> blocks;
  for (size_t slot = 0; slot < space_.active().size(); ++slot) {
    const VoxelSpace::Block& block = space_.active()[slot];
    const int at = space_.grid().BlockAt(block.x, block.y, block.z);
    if (with_voxels[static_cast<size_t>(at)]) blocks.push_back(static_cast<int>(slot));
  }
  return blocks;
}

bool PossibleSpace::AlwaysMet(const VoxelPart& part) const {
  bool any_image = false;
  for (size_t view = 0; view < possible_pixels_.size(); ++view) {
    if (!possible_pixels_[view]) continue;
    any_image = true;
    const VoxelSet& covered = space_.always_covered(static_cast<int>(view));
    const bool met = std::any_of(part.runs.begin(), part.runs.end(), [&](const VoxelRun& run) {
      for (int x = run.first; x <= run.last; ++x) {
        if (covered.at(x, run.y, run.z)) return true;
      }
      return false;
    });
    if (!met) return false;
  }
  return any_image;
}

PossibleSpace::Part PossibleSpace::Drawn(const VoxelPart& part, const VoxelSet& surface) const {
  PartPlanes planes(space_);
  for (const VoxelRun& run : part.runs) {
    const bool outermost = run.y == part.low[1] || run.y == part.high[1] || run.z == part.low[2] ||
                           run.z == part.high[2];
    for (int x = run.first; x <= run.last; ++x) {
      if (outermost || x == part.low[0] || x == part.high[0] || surface.at(x, run.y, run.z)) {
        planes.Add(*space_.PlaceOf(x, run.y, run.z));
      }
    }
  }
  return planes.Cut(possible_pixels_);
}

bool PossibleSpace::BodyTouches(const VoxelSet& voxels, std::span<const int> blocks,
                                const MayTouch& body) const {
  for (int slot : blocks) {
    const VoxelSpace::Block& block = space_.active()[static_cast<size_t>(slot)];
    if (!body(space_.BoxOf(block))) continue;
    for (int row = 0; row < kPossibleSpaceEdge * kPossibleSpaceEdge; ++row) {
      const int y = block.y * kPossibleSpaceEdge + row % kPossibleSpaceEdge;
      const int z = block.z * kPossibleSpaceEdge + row / kPossibleSpaceEdge;
      for (unsigned left = voxels.RowOfBlock(block.x, y, z); left != 0; left &= left - 1) {
        const int x = block.x * kPossibleSpaceEdge + std::countr_zero(left);
        if (body(space_.grid().Box(x, y, z))) return true;
      }
    }
  }
  return false;
}

bool PossibleSpace::PlanesMeet(std::span<const MaskWords> robot, int min_views,
                               const MayTouch& body) const {
  const int may_miss = space_.views() - min_views;
  const bool meet = std::any_of(parts_.begin(), parts_.end(), [&](const Part& part) {
    int missed = 0;
    for (size_t view = 0; view < robot.size() && missed <= may_miss; ++view) {
      const std::optional<Mask>& plane = part.planes[view];
      if (!plane || Intersects(plane->words(), robot[view])) continue;
      if (!part.beyond[view] || !NothingSet(robot[view])) ++missed;
    }
    return missed <= may_miss;
  });
  if (meet || always_met_blocks_.empty()) return meet;
  return !body || BodyTouches(always_met_, always_met_blocks_, body);
}

bool PossibleSpace::VoxelsMeet(std::span<const MaskWords> robot, int min_views,
                               const MayTouch& body) const {
  return Meet(voxels_.remaining, remaining_blocks_, possible_pixels_, robot,
              space_.views() - min_views, body);
}

bool PossibleSpace::PlainMeet(std::span<const MaskWords> robot, const MayTouch& body) const {
  return Meet(voxels_.plain, plain_blocks_, obstacle_pixels_, robot, max_occluded_views_, body);
}

bool PossibleSpace::Meet(const VoxelSet& voxels, std::span<const int> blocks,
                         const CollisionImages& pixels, std::span<const MaskWords> robot,
                         int may_miss, const MayTouch& body) const {
  const RobotQuery query(space_, pixels, robot, may_miss);
  for (int slot : blocks) {
    const VoxelSpace::Block& block = space_.active()[static_cast<size_t>(slot)];
    if (!query.MeetsBlock(static_cast<size_t>(slot))) continue;
    if (body && !body(space_.BoxOf(block))) continue;
    for (int row = 0; row < kPossibleSpaceEdge * kPossibleSpaceEdge; ++row) {
      const int y = block.y * kPossibleSpaceEdge + row % kPossibleSpaceEdge;
      const int z = block.z * kPossibleSpaceEdge + row / kPossibleSpaceEdge;
      for (unsigned left = voxels.RowOfBlock(block.x, y, z); left != 0; left &= left - 1) {
        const int x = std::countr_zero(left);
        const size_t place = static_cast<size_t>(slot) * VoxelGrid::kBlockVoxels +
                             static_cast<size_t>(row * kPossibleSpaceEdge + x);
        if (!query.MeetsVoxel(place)) continue;
        if (!body || body(space_.grid().Box(block.x * kPossibleSpaceEdge + x, y, z))) return true;
      }
    }
  }
  return false;
}

bool PossibleSpace::AnyCentre(const MayTouch& met) const {
  return BodyTouches(voxels_.centres, centre_blocks_, met);
}

bool PossibleSpace::VoxelMeets(std::span<const MaskWords> robot, int min_views, int x, int y,
                               int z) const {
  const RobotQuery query(space_, possible_pixels_, robot, space_.views() - min_views);
  const std::optional<size_t> place = space_.PlaceOf(x, y, z);
  return place && query.MeetsVoxel(*place);
}

}  // namespace silhouette
