// SPDX-License-Identifier: Apache-2.0
// What may hold an obstacle in one scene, in voxels.
//
// Every obstacle is a union of balls of radius rho, the least obstacle. A ball can be only where
//   * in every view, all pixels that it touches are something other than background;
//   * it does not reach into the robot's own body at the robot's present configuration.
// What such balls cover is the possible space, opened by the ball: the thin shell between the robot
// and what its silhouettes enclose holds no ball and vanishes; what is left can hold an obstacle. A
// possible voxel that an image shows as obstacle stays, however small what is there, unless more
// than max_occluded_views of the images that show it have unknown or error pixels alone there: what
// most views see plainly is never opened away.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>

#include "db/mask/mask.h"
#include "server/collision/collision_images.h"
#include "server/collision/voxel_grid.h"
#include "server/collision/voxel_space.h"

namespace silhouette {

// The signed distance, metres, of a point from the robot's own body at its present configuration,
// negative inside; or more: then the body counts for less. It changes by no more than the way
// between two points. Empty: nothing is known of the body.
using BodyDistance = std::function<double(const Eigen::Vector3d&)>;

// A plain value.
struct PossibleVoxels {
  // `images`: one, or nothing, per view of the space, of its mask size. A view without an image
  // says nothing. `allowed`: empty, or per view the pixels in which an obstacle is allowed, if any;
  // a voxel is taken away if in every view that sees it all pixels other than background that it
  // touches are allowed. `max_occluded_views`: MaxOccludedViews of the policy. Throws
  // std::invalid_argument if something has not the right size, or it is negative.
  PossibleVoxels(const VoxelSpace& space, const ObstacleImages& images, const BodyDistance& body,
                 std::span<const std::optional<Mask>> allowed, int max_occluded_views);

  // All of it, where the robot may be met.
  VoxelSet remaining;
  // Of these, what stays however small the obstacle.
  VoxelSet plain;
  // Where balls of the least obstacle may have their centres.
  VoxelSet centres;
};

}  // namespace silhouette
