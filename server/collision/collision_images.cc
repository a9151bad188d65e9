#include "server/collision/collision_images.h"

namespace silhouette {

std::vector<Mask> UncalibratedCollisionImages(const std::vector<IntersectionImage>& images) {
  std::vector<Mask> collision_images;
  for (const IntersectionImage& image : images) collision_images.push_back(image.obstacle());
  return collision_images;
}

}  // namespace silhouette
