#include "server/collision/collision_images.h"

#include <stdexcept>
#include <utility>

#include "server/collision/line_search.h"

namespace silhouette {
namespace {

template <typename Image>
CollisionImages Resolve(const std::vector<std::optional<Image>>& images, const EpipolarBands& bands,
                        bool errors_convict) {
  if (images.size() != static_cast<size_t>(bands.views())) {
    throw std::invalid_argument("there must be one image per view of the calibration");
  }
  std::vector<SearchedImage> searched(images.size());
  for (size_t view = 0; view < images.size(); ++view) {
    if (!images[view]) continue;
    if (images[view]->size() != bands.mask_sizes()[view]) {
      throw std::invalid_argument("an image has not the mask size of the calibration");
    }
    searched[view] = {images[view]->obstacle().words(), images[view]->unknown().words(),
                      images[view]->error().words()};
  }
  LineSearch search;
  search.Begin(bands, searched, errors_convict);
  CollisionImages collision_images(images.size());
  for (size_t view = 0; view < images.size(); ++view) {
    if (!images[view]) continue;
    const MaskWords obstacle = searched[view].obstacle;
    std::vector<uint64_t> words(obstacle.begin(), obstacle.end());
    search.AddObstacles(static_cast<int>(view), words);
    collision_images[view] = Mask::FromWords(images[view]->size(), std::move(words));
  }
  return collision_images;
}

}  // namespace

CollisionImages UncalibratedCollisionImages(const IntersectionImages& images) {
  CollisionImages collision_images;
  for (const std::optional<IntersectionImage>& image : images) {
    collision_images.push_back(image ? std::optional<Mask>(image->obstacle()) : std::nullopt);
  }
  return collision_images;
}

CollisionImages CalibratedCollisionImages(const IntersectionImages& images,
                                          const EpipolarBands& bands, bool errors_convict) {
  return Resolve(images, bands, errors_convict);
}

CollisionImages ResolvedObstacleImages(const ObstacleImages& images, const EpipolarBands& bands,
                                       bool errors_convict) {
  return Resolve(images, bands, errors_convict);
}

}  // namespace silhouette
