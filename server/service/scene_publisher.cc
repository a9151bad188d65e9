#include "server/service/scene_publisher.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

namespace silhouette {

void ScenePublisher::LogDefects(const Scene& scene) {
  std::set<Reason> reasons;
  std::string messages;
  for (const SceneDefect& defect : scene.defects) {
    reasons.insert(defect.reason);
    absl::StrAppend(&messages, messages.empty() ? "" : "; ", defect.message);
  }
  const std::lock_guard lock(mutex_);
  if (scene.id < logged_scene_) return;  // overtaken by a newer one
  logged_scene_ = scene.id;
  if (reasons == logged_reasons_) return;
  if (reasons.empty()) {
    spdlog::info("scene {} is good again", scene.id);
  } else {
    spdlog::warn("scene {} is not good: {}", scene.id, messages);
  }
  logged_reasons_ = std::move(reasons);
}

void ScenePublisher::PrepareSpace(const ServedDatabase& whole, const Scene& scene) const {
  if (!IsSound(DefaultPolicy(settings_, whole).preset)) return;
  const ServedDatabase* variant = whole.Variant(scene.variant);
  if (variant == nullptr || variant->sound() == nullptr || scene.Blocked() != Reason::kNone) return;
  scene.possible_space.Get(variant->sound(), scene.obstacle_images, scene.joints, {});
}

absl::StatusOr<SharedScene> ScenePublisher::Publish(
    Scene scene, const std::shared_ptr<const ServedDatabase>& database) {
  absl::StatusOr<SharedScene> published = scenes_.Publish(std::move(scene), database);
  if (!published.ok()) return published;
  LogDefects(**published);
  PrepareSpace(*database, **published);
  return published;
}

}  // namespace silhouette
