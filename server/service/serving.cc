// SPDX-License-Identifier: Apache-2.0
#include "server/service/serving.h"

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
  switch (log_.Note(reasons, scene.arrived.running)) {
    case FaultLog<Reason>::News::kNone:
      return;
    case FaultLog<Reason>::News::kFault:
      spdlog::warn("scene {} is not good: {}", scene.id, messages);
      return;
    case FaultLog<Reason>::News::kRecovered:
      spdlog::info("scenes are good again, as scene {}", scene.id);
  }
}

void ScenePublisher::PrepareSpace(const ServedDatabase& whole, const Scene& scene) const {
  const Policy policy = DefaultPolicy(settings_, whole);
  if (!IsSound(policy.preset)) return;
  const ServedDatabase* variant = whole.Variant(scene.variant);
  if (variant == nullptr || variant->sound() == nullptr || scene.Blocked() != Reason::kNone) return;
  scene.possible_space.Get(variant->sound(), scene.obstacle_images, scene.joints, {},
                           MaxOccludedViews(policy, whole.views()));
}

absl::StatusOr<SharedScene> ScenePublisher::Publish(
    Scene scene, const std::shared_ptr<const ServedDatabase>& database) {
  absl::StatusOr<SharedScene> published = scenes_.Publish(std::move(scene), database);
  if (!published.ok()) return published;
  LogDefects(**published);
  PrepareSpace(*database, **published);
  return published;
}

WorkerPoolSettings Serving::PoolOf(const std::string& name, int nice) const {
  return {.name = name,
          .threads = settings.worker_threads,
          .queue = static_cast<size_t>(settings.limits.waiting),
          .queue_per_client = static_cast<size_t>(settings.limits.waiting_per_client),
          .queued_bytes = settings.limits.request_memory / 3,  // there are three pools
          .nice = nice};
}

bool DrawsMaps(const ServedDatabase& database) {
  return database.robot_images().drawn() != nullptr && database.index() == nullptr &&
         database.node_index(DrawnKind::kReach) == nullptr;
}

std::optional<bool> Slides(const ServingSettings& settings, const GridJoint& joint) {
  if (joint.continuous) return false;
  const auto found = settings.joint_slides.find(joint.name);
  return found != settings.joint_slides.end() ? std::optional(found->second) : std::nullopt;
}

Policy DefaultPolicy(const ServingSettings& settings, const ServedDatabase& database) {
  Policy policy = settings.policy;
  if (settings.choose_preset) policy.preset = database.BestPreset();
  return policy;
}

}  // namespace silhouette
