#include "server/service/explain.h"

#include <optional>

#include "common/picture/picture.h"
#include "server/collision/collision_images.h"
#include "server/collision/intersection_image.h"

namespace silhouette {
namespace {

// The planes, and in colours of their own the unknown pixels that are ignored and those that
// allowed regions made unknown.
Picture PictureOfView(const Scene& scene, size_t view, const Mask& obstacle, const Mask& unknown,
                      const Mask& error) {
  Picture picture = PictureOfPlanes(obstacle, unknown, error);
  const auto veil = [&](const std::optional<Mask>& pixels, Colour colour) {
    if (pixels) picture = WithVeil(picture, *pixels & unknown, colour, 1);
  };
  veil(scene.views[view]->ignored, palette::kIgnored);
  for (const RegionEffect& effect : scene.region_effects) {
    veil(effect.taken[view], palette::kAllowed);
  }
  return picture;
}

}  // namespace

void ExplainViews(const Checker& checker, std::span<const double> q,
                  v1::ExplainResponse* response) {
  const Served& served = checker.served();
  if (served.scene == nullptr) return;
  const CollisionImages collision = checker.CollisionImagesAt(q);
  for (int view = 0; view < served.database->views(); ++view) {
    v1::ViewExplanation& explanation = *response->add_views();
    explanation.set_view(served.database->view_name(view));
    const auto i = static_cast<size_t>(view);
    if (!served.scene->views[i]) continue;
    explanation.set_scene_png(EncodePng(PictureOf(served.scene->views[i]->foreground)));
    if (!served.scene->obstacle_images[i]) continue;
    const ObstacleImage& obstacle = *served.scene->obstacle_images[i];
    const Scene& scene = *served.scene;
    explanation.set_obstacle_png(EncodePng(
        PictureOfView(scene, i, obstacle.obstacle(), obstacle.unknown(), obstacle.error())));
    const std::optional<Mask> robot = checker.TestRobotImage(view, q);
    if (!robot) continue;
    const IntersectionImage intersection(obstacle, *robot);
    explanation.set_intersection_png(EncodePng(PictureOfView(
        scene, i, intersection.obstacle(), intersection.unknown(), intersection.error())));
    if (!collision[i]) continue;
    const Mask none(collision[i]->size());
    explanation.set_collision_png(EncodePng(PictureOfPlanes(*collision[i], none, none)));
  }
}

}  // namespace silhouette
