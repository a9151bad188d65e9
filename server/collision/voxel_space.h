// SPDX-License-Identifier: Apache-2.0
// The space of a cell in voxels, and what every view can say of each: made once per calibration and
// workspace, for the sound test (possible_space.h).
//
// Of a voxel and a view it knows
//   * the touched pixels: every pixel that shows any point of the voxel, where that is in the
//   image;
//   * the certain pixels: only pixels that every ball of radius `least_obstacle` touches whose
//     centre lies anywhere in the voxel.
// The error of the calibration widens the first and narrows the second. Cannot be changed once
// made; used by any number of threads.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/obstacle_image.h"
#include "server/collision/voxel_grid.h"

namespace silhouette {

// How a view sees space.
struct VoxelView {
  MaskSize mask_size;
  // Mask-pixel coordinates of a point in the robot's base frame, integers at pixel centres, inside
  // the image or not; nothing where the camera cannot tell. Smooth at the size of a block of
  // voxels.
  std::function<std::optional<Eigen::Vector2d>(const Eigen::Vector3d&)> project;
  // Mask pixels along x and y by which a point may appear elsewhere, and a rim be missed.
  Eigen::Vector2d margin = Eigen::Vector2d::Zero();
  // The union of all robot images that will ever be tested; of no size where that is not known.
  Mask swept{};
  // Pixels that the robot covers in each of them; of no size where none is known.
  Mask permanent{};
  // Pixels in which those images may lack the robot, such as behind a pillar before the camera; of
  // no size where there are none. Look::Ignores: a robot counts as seen in them wherever it is.
  Mask ignored{};
};

// Pixels [x, x + width) x [y, y + height) of a view; no pixels where both are 0.
struct PixelRectangle {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
  // Whether all of the voxel is in the image. If not, the view says nothing of it.
  bool whole = false;

  bool operator==(const PixelRectangle&) const = default;
};

// Whether `test` is true of a word of an image of this width, and the bits in it that belong to the
// rectangle: test(word, bits).
template <typename Test>
bool AnyWord(int image_width, const PixelRectangle& pixels, const Test& test) {
  for (int y = 0; y < pixels.height; ++y) {
    int bit = (pixels.y + y) * image_width + pixels.x;
    for (int left = pixels.width; left > 0;) {
      const int in_word = std::min(left, 64 - bit % 64);
      const uint64_t bits = ~uint64_t{0} >> (64 - in_word) << (bit % 64);
      if (test(static_cast<size_t>(bit) / 64, bits)) return true;
      bit += in_word;
      left -= in_word;
    }
  }
  return false;
}

// Whether a pixel of the rectangle is set in both images, which have this width.
inline bool AnyCommon(MaskWords a, MaskWords b, int image_width, const PixelRectangle& pixels) {
  return AnyWord(image_width, pixels,
                 [&](size_t word, uint64_t bits) { return (a[word] & b[word] & bits) != 0; });
}

// Whether the robot, which is of one piece, may reach beyond this image, which shows all of it that
// is there: it then touches the rim of the image, or is nowhere in it.
inline bool MayReachBeyond(MaskWords robot, MaskSize size) {
  const auto any = [&](const PixelRectangle& pixels) {
    return AnyCommon(robot, robot, size.width, pixels);
  };
  return any({0, 0, size.width, 1}) || any({0, size.height - 1, size.width, 1}) ||
         any({0, 0, 1, size.height}) || any({size.width - 1, 0, 1, size.height}) ||
         NothingSet(robot);
}

// Pixels of one row of a mask, relative to some pixel: (first..last, dy).
struct PixelRun {
  int dy = 0;
  int first = 0;
  int last = 0;

  auto operator<=>(const PixelRun&) const = default;  // NOLINT(modernize-use-nullptr)
};
using PixelShape = std::vector<PixelRun>;

class VoxelSpace {
 public:
  static constexpr int kMostViews = 127;

  // `workspace`: holds every point that the robot ever reaches. `least_obstacle`: rho, the radius
  // of the balls that every obstacle is a union of. `edge`: of the voxels; nothing: a third of rho.
  // Throws std::invalid_argument if there is no view or more than kMostViews, a length is not
  // positive, a mask or margin is invalid, the masks are too large for this many voxels, or as
  // VoxelGrid does.
  VoxelSpace(const Eigen::AlignedBox3d& workspace, double least_obstacle,
             std::vector<VoxelView> views, std::optional<double> edge = std::nullopt);

  // The voxels: those of the workspace, and around it as many as a ball that meets it may have its
  // centre in.
  const VoxelGrid& grid() const { return grid_; }
  double least_obstacle() const { return least_obstacle_; }
  int views() const { return static_cast<int>(looks_.size()); }
  MaskSize mask_size(int view) const { return look(view).mask_size; }

  // The voxels where the robot could be met: those of the workspace that the robot covers in every
  // view at some configuration, as far as views and swept pixels tell.
  const VoxelSet& reached() const { return reached_; }
  // The voxels that at least one view sees whole.
  const VoxelSet& seen() const { return seen_; }

  // The voxels that touch a permanent pixel of the view, or pixels that Look::Ignores.
  const VoxelSet& always_covered(int view) const {
    return always_covered_[static_cast<size_t>(view)];
  }

  // The touched pixels of a voxel; none outside the active blocks.
  PixelRectangle Touched(int view, int x, int y, int z) const;

  // What follows is for possible_space.cc.

  // Blocks in which a ball that meets a reached voxel may have its centre. All else is nowhere
  // looked at. `slot`: the place of the block's voxels in the arrays below.
  struct Block {
    int x = 0;  // block coordinates
    int y = 0;
    int z = 0;
  };
  const std::vector<Block>& active() const { return active_; }
  Eigen::AlignedBox3d BoxOf(const Block& block) const;

  struct RectangleKind {
    int width = 0;
    int height = 0;
    bool whole = false;

    auto operator<=>(const RectangleKind&) const = default;  // NOLINT(modernize-use-nullptr)
  };

  struct Look {
    MaskSize mask_size;
    // Per voxel of the active blocks, in the order x, y, z within the block: 0, or 1 + kind *
    // pixels
    // + the rectangle's first pixel.
    std::vector<uint32_t> touched;
    std::vector<RectangleKind> kinds;
    // Likewise: (shape * height + y) * row_bits() + x, where (x, y) is the pixel that the shape is
    // relative to. The first shape has no pixels: nothing is asked for.
    std::vector<uint32_t> certain;
    std::vector<PixelShape> shapes;
    // Per active block: what all of its voxels touch; whole if all of them are.
    std::vector<PixelRectangle> block_touched;
    // VoxelView::ignored.
    Mask ignored;
    // Whether the robot may leave the image through ignored pixels at its rim.
    bool leaves_unseen = false;

    // Whether a robot counts as seen in these pixels wherever it is: the view may lack it in some
    // of them, or it may leave the image there unseen.
    bool Ignores(const PixelRectangle& pixels) const {
      if (!pixels.whole && leaves_unseen) return true;
      return ignored.size() == mask_size &&
             AnyCommon(ignored.words(), ignored.words(), mask_size.width, pixels);
    }
    PixelRectangle Rectangle(uint32_t touched_index) const;
    // A row of pixels, rounded up to whole words.
    uint32_t row_bits() const { return (static_cast<uint32_t>(mask_size.width) + 63) / 64 * 64; }
  };
  const Look& look(int view) const { return looks_[static_cast<size_t>(view)]; }

  // The place of a voxel in the arrays of a Look; nothing outside the active blocks.
  std::optional<size_t> PlaceOf(int x, int y, int z) const;

 private:
  void FindActiveBlocks(std::span<const VoxelView> views, const Eigen::AlignedBox3d& workspace);
  void FindReached(std::span<const VoxelView> views, const Eigen::AlignedBox3d& workspace);

  double least_obstacle_;
  VoxelGrid grid_;
  std::vector<Block> active_;
  std::vector<int32_t> slots_;  // per block: its place in active_, -1: none
  std::vector<Look> looks_;
  VoxelSet reached_;
  VoxelSet seen_;
  std::vector<VoxelSet> always_covered_;
};

}  // namespace silhouette
