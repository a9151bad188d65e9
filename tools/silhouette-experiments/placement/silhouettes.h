// SPDX-License-Identifier: Apache-2.0
// Silhouettes: the masks of bodies made of triangles, without a camera's noise. A pixel is set if
// any part of it is touched, to a quarter of a pixel.
#pragma once

#include <span>
#include <vector>

#include "calib/camera/camera_model.h"
#include "capture/sim/body_part.h"
#include "db/mask/mask.h"

namespace silhouette {

// A part whose silhouette is wanted often.
struct Solid {
  size_t frame = 0;
  TriangleMesh mesh;
  bool convex = false;  // its silhouette is the hull of its corners' images
};

std::vector<Solid> SolidsOf(std::span<const BodyPart> parts);

// The image's size, in the camera's intrinsics, is that of the mask.
Mask SilhouetteOf(std::span<const Solid> solids, const Poses& poses, const CameraModel& camera);

// Whether all corners of all solids are inside the image.
bool IsWhole(std::span<const Solid> solids, const Poses& poses, const CameraModel& camera);

}  // namespace silhouette
