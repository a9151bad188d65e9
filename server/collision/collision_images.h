// Collision images: intersection images whose unknown and error pixels are resolved to obstacle or
// background (paper §3.3). The set bits are the obstacle pixels.
#pragma once

#include <optional>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/epipolar_bands.h"
#include "server/collision/intersection_image.h"
#include "server/collision/obstacle_image.h"

namespace silhouette {

// Per view; nothing where the scene lacks the view.
using ObstacleImages = std::vector<std::optional<ObstacleImage>>;
using IntersectionImages = std::vector<std::optional<IntersectionImage>>;
using CollisionImages = std::vector<std::optional<Mask>>;

// Without a calibration nothing can be resolved: unknown and error become background, and the
// number of views that must show an obstacle (policy.h) makes up for it.
CollisionImages UncalibratedCollisionImages(const IntersectionImages& images);

// Resolved along the epipolar lines (line_search.h) in the intersection images. One image, or
// nothing, per view of `bands`, of its mask size, else std::invalid_argument.
CollisionImages CalibratedCollisionImages(const IntersectionImages& images,
                                          const EpipolarBands& bands, bool errors_convict);

// The same in the obstacle images, which does not depend on the test configuration: cut with the
// test robot image it is the collision image.
CollisionImages ResolvedObstacleImages(const ObstacleImages& images, const EpipolarBands& bands,
                                       bool errors_convict);

}  // namespace silhouette
