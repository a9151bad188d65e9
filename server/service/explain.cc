#include "server/service/explain.h"

#include <optional>

#include "server/collision/collision_images.h"
#include "server/collision/intersection_image.h"
#include "tools/picture/picture.h"

namespace silhouette {

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
    explanation.set_obstacle_png(
        EncodePng(PictureOfPlanes(obstacle.obstacle(), obstacle.unknown(), obstacle.error())));
    const std::optional<Mask> robot = checker.TestRobotImage(view, q);
    if (!robot) continue;
    const IntersectionImage intersection(obstacle, *robot);
    explanation.set_intersection_png(EncodePng(
        PictureOfPlanes(intersection.obstacle(), intersection.unknown(), intersection.error())));
    if (!collision[i]) continue;
    const Mask none(collision[i]->size());
    explanation.set_collision_png(EncodePng(PictureOfPlanes(*collision[i], none, none)));
  }
}

}  // namespace silhouette
