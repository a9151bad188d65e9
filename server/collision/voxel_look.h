// SPDX-License-Identifier: Apache-2.0
// How one view sees blocks of voxels: the geometry behind VoxelSpace.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/obstacle_image.h"
#include "server/collision/voxel_space.h"

namespace silhouette {

// A rectangle of the image plane, in pixel coordinates.
using PlaneBox = Eigen::AlignedBox2d;

// Fills in a VoxelSpace::Look, block by block.
class VoxelLooker {
 public:
  // Refers to `view`, `grid` and `look`, which must outlive it.
  VoxelLooker(const VoxelView& view, const VoxelGrid& grid, double least_obstacle,
              VoxelSpace::Look& look);

  // The pixels that any voxel of a block may touch; not whole where one may be out of the image.
  PixelRectangle BlockRectangle(const VoxelSpace::Block& block);

  // Appends the block's voxels. Throws std::invalid_argument if they have more kinds or shapes than
  // the entries of a Look can number.
  void Append(const VoxelSpace::Block& block);

 private:
  static constexpr int kCorners = VoxelGrid::kBlockEdge + 1;
  // Shapes that the images of balls surely touch whose semi-axes are these, or more. Those of all
  // voxels of a block are the same, so that only a few shapes are looked up at a time.
  struct BallShapes {
    int steps = 0;                                    // per pixel
    Eigen::Vector2i radii = Eigen::Vector2i::Zero();  // semi-axes, in steps
    // By the size of the box of the balls' centres, and by where its middle is from the pixel that
    // shapes are relative to; kNotMade: not looked up yet.
    std::map<std::pair<int, int>, std::vector<uint32_t>> by_centres{};

    static constexpr uint32_t kNotMade = ~uint32_t{0};
    // The entry of a box, in steps, whose middle is in that pixel.
    uint32_t& Of(const Eigen::Vector2i& from, const Eigen::Vector2i& to);
  };

  void ProjectCorners(const VoxelSpace::Block& block);
  const std::optional<Eigen::Vector2d>& Corner(int x, int y, int z) const {
    return corners_[static_cast<size_t>((z * kCorners + y) * kCorners + x)];
  }
  // Where the voxel or block between two corners appears.
  std::optional<PlaneBox> Image(int x, int y, int z, int edges) const;
  PixelRectangle Pixels(const std::optional<PlaneBox>& image) const;
  uint32_t TouchedIndex(const PixelRectangle& pixels);
  // Semi-axes of an ellipse that the image of a ball with its centre in the block surely fills,
  // about the image of its centre; nothing if it is not sure to fill anything.
  std::optional<Eigen::Vector2d> BallAxes(const VoxelSpace::Block& block) const;
  // Null if there is none.
  BallShapes* BallsOf(const VoxelSpace::Block& block);
  uint32_t CertainIndex(const PlaneBox& centres, BallShapes& balls);

  const VoxelView& view_;
  const VoxelGrid& grid_;
  double least_obstacle_;
  VoxelSpace::Look& look_;

  std::vector<std::optional<Eigen::Vector2d>> corners_;
  double bulge_ = 0;  // pixels by which a voxel's image may exceed its corners'
  std::map<VoxelSpace::RectangleKind, uint32_t> kinds_;
  std::map<std::array<int, 3>, BallShapes> ball_shapes_;  // by steps and radii
  std::map<PixelShape, uint32_t> shapes_;
};

// Whether all certain pixels of a voxel are foreground, in words of one image per shape. A word is
// made when it is asked for: most never are.
class CertainImages {
 public:
  // Refers to `look`, which must outlive it.
  CertainImages(const VoxelSpace::Look& look, const Mask& foreground);

  // By an entry of VoxelSpace::Look::certain. For one thread.
  bool At(uint32_t index) {
    const size_t word = index / 64;
    if ((made_[word / 64] >> (word % 64) & 1) == 0) Make(word);
    return (words_[word] >> (index % 64) & 1) != 0;
  }

 private:
  void Make(size_t word);
  // The image in which a pixel is set if all pixels from `first` to `last` of its row are, relative
  // to it.
  const std::vector<uint64_t>& RunImage(int first, int last);

  const std::vector<PixelShape>& shapes_;
  int width_;
  size_t height_;
  size_t row_words_;
  std::vector<uint64_t> foreground_;  // set also where there is no image
  std::vector<std::vector<uint64_t>> run_images_;
  std::unique_ptr<uint64_t[]> words_;
  std::vector<uint64_t> made_;  // a bit per word
};

// One view's image in tables, so that one look-up returns what a voxel touches: made once per
// scene, for one thread.
class LookTables {
 public:
  // Of the pixels that a voxel touches:
  static constexpr uint8_t kPossible = 1;  // one is not background, or the view says nothing
  static constexpr uint8_t kObstacle = 2;  // one is an obstacle, or the view says nothing
  static constexpr uint8_t kAllowed = 4;   // all that are not background are allowed
  static constexpr uint8_t kShown = 8;     // one is an obstacle

  // Without an image the view says nothing, and allows nothing. `allowed`: the allowed pixels, if
  // any. Refers to `look`, which must outlive it.
  LookTables(const VoxelSpace::Look& look, const std::optional<ObstacleImage>& image,
             const std::optional<Mask>& allowed);

  // By an entry of VoxelSpace::Look::touched.
  const uint8_t* touched() const { return touched_.data(); }

  // Whether a ball may have its centre in a voxel, by an entry of VoxelSpace::Look::certain.
  bool CentrePossible(uint32_t index) { return !certain_ || certain_->At(index); }
  // Whether any pixel of a rectangle is not background.
  bool AnyPossible(const PixelRectangle& pixels) const;

 private:
  void FillTouched(const VoxelSpace::Look& look, const ObstacleImage& image,
                   const std::optional<Mask>& allowed);

  int width_ = 0;
  std::vector<uint8_t> touched_;
  std::optional<CertainImages> certain_;  // of an image
  // Per corner of a pixel, how many pixels above and left of it are not background.
  std::vector<uint32_t> sums_;
};

}  // namespace silhouette
