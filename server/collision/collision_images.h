// Collision images: intersection images whose unknown and error pixels are resolved to obstacle or
// background (paper §3.3). The set bits are the obstacle pixels.
#pragma once

#include <vector>

#include "db/mask.h"
#include "server/collision/intersection_image.h"

namespace silhouette {

// Without a calibration nothing can be resolved: unknown and error become background, and the
// number of views that must show an obstacle (policy.h) makes up for it. One collision image per
// intersection image.
std::vector<Mask> UncalibratedCollisionImages(const std::vector<IntersectionImage>& images);

}  // namespace silhouette
