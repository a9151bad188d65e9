// SPDX-License-Identifier: Apache-2.0
// Where an obstacle could be, seen or not: the sound test (docs/verdict-quality.md).
//
// What may hold an obstacle (possible_voxels.h) falls into parts, and where the robot meets an
// obstacle there is a point of one of them. It remains in two forms. As planes per part and view,
// which do not depend on the test configuration: the robot may meet the part if the planes meet its
// robot images in all views. And as voxels: then one and the same voxel must meet the robot image
// in every view, and the robot's body where that is known.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/collision_images.h"
#include "server/collision/possible_voxels.h"
#include "server/collision/voxel_grid.h"
#include "server/collision/voxel_space.h"

namespace silhouette {

// Refers to the voxel space, which must outlive it. Cannot be changed once made; used by any number
// of threads.
class PossibleSpace {
 public:
  // The arguments and errors are those of PossibleVoxels.
  PossibleSpace(const VoxelSpace& space, const ObstacleImages& images, const BodyDistance& body,
                std::span<const std::optional<Mask>> allowed = {}, int max_occluded_views = 1);

  const VoxelSpace& space() const { return space_; }

  // Whether there was an image of the view.
  bool sees(int view) const { return possible_pixels_[static_cast<size_t>(view)].has_value(); }

  // What may hold an obstacle, where the robot may be met.
  const VoxelSet& remaining() const { return voxels_.remaining; }

  // What remains in parts, as planes: the connected parts, and pieces of those whose planes would
  // meet the robot at any configuration, because it always covers some of their pixels in every
  // view with an image. Pieces that are small and always met have no planes: always_met().
  static constexpr size_t kMostParts = 16;
  struct Part {
    // Per view the pixels in which the part is seen; nothing for a view without an image, and where
    // a voxel of it is in pixels that VoxelSpace::Look::Ignores, so that the robot always meets it.
    // Where it reaches beyond the image, the image's rim is in the plane: a robot that meets it out
    // there touches the rim, or is nowhere in the image.
    CollisionImages planes;
    std::vector<bool> beyond;  // per view, whether it reaches beyond the image
  };
  const std::vector<Part>& parts() const { return parts_; }
  const VoxelSet& always_met() const { return always_met_; }

  // Whether a box may touch the robot, tool and payload at the configuration asked for; pieces of
  // it that are exactly where they are at present may be left out, for they touch nothing now. If
  // that is not known, nothing.
  using MayTouch = std::function<bool(const Eigen::AlignedBox3d&)>;

  // All three: the images of a robot, one per view; a view without an image counts as met. Never
  // allocate. `min_views`: 1 to the number of views.

  // Whether the planes of a part meet the robot in `min_views` views, or its body may touch one of
  // always_met(); without a body, it does.
  bool PlanesMeet(std::span<const MaskWords> robot, int min_views,
                  const MayTouch& body = nullptr) const;

  // Whether one and the same remaining voxel meets it in `min_views` views, and its body.
  bool VoxelsMeet(std::span<const MaskWords> robot, int min_views,
                  const MayTouch& body = nullptr) const;

  // Whether the robot meets what the images show, however small it is: a voxel that stays for that
  // reason meets it in obstacle pixels, in all views but max_occluded_views, and its body. A view
  // that does not show all of the voxel counts as met if the robot may reach beyond its image.
  bool PlainMeet(std::span<const MaskWords> robot, const MayTouch& body = nullptr) const;

  // Whether there is a voxel in which a ball of the least obstacle may have its centre, and `met`
  // is true of it. Also asked of boxes that hold such voxels, and true if it is of one of them.
  bool AnyCentre(const MayTouch& met) const;

  // Whether a voxel meets it in `min_views` views; one that the space looks at at all.
  bool VoxelMeets(std::span<const MaskWords> robot, int min_views, int x, int y, int z) const;

 private:
  void FindParts(const ObstacleImages& images);
  bool AlwaysMet(const VoxelPart& part) const;
  Part Drawn(const VoxelPart& part, const VoxelSet& surface) const;
  std::vector<int> BlocksOf(const VoxelSet& voxels) const;
  bool BodyTouches(const VoxelSet& voxels, std::span<const int> blocks, const MayTouch& body) const;
  // Whether one of the voxels meets the robot in all views but `may_miss`, in `pixels`, and its
  // body.
  bool Meet(const VoxelSet& voxels, std::span<const int> blocks, const CollisionImages& pixels,
            std::span<const MaskWords> robot, int may_miss, const MayTouch& body) const;

  const VoxelSpace& space_;
  PossibleVoxels voxels_;
  VoxelSet always_met_;
  std::vector<int> always_met_blocks_;  // places in space_.active()
  std::vector<int> remaining_blocks_;   // places in space_.active()
  std::vector<int> plain_blocks_;       // places in space_.active()
  std::vector<int> centre_blocks_;      // places in space_.active()
  std::vector<Part> parts_;
  CollisionImages possible_pixels_;  // those that are not background
  CollisionImages obstacle_pixels_;
  int max_occluded_views_;
};

}  // namespace silhouette
