// Where scenes become what verdicts rest on, wherever they come from.
#pragma once

#include <memory>
#include <mutex>
#include <set>

#include "absl/status/statusor.h"
#include "server/scene/scene.h"
#include "server/scene/scene_store.h"
#include "server/service/serving_settings.h"

namespace silhouette {

// Thread-safe.
class ScenePublisher {
 public:
  // Both must outlive it.
  ScenePublisher(const ServingSettings& settings, SceneStore& scenes)
      : settings_(settings), scenes_(scenes) {}

  // As SceneStore::Publish. Writes a line to the log when the scenes' defects change.
  absl::StatusOr<SharedScene> Publish(Scene scene,
                                      const std::shared_ptr<const ServedDatabase>& database);

 private:
  void LogDefects(const Scene& scene);
  // Finds the scene's possible space, if verdicts rest on it by default: so that no check waits.
  void PrepareSpace(const ServedDatabase& whole, const Scene& scene) const;

  const ServingSettings& settings_;
  SceneStore& scenes_;
  std::mutex mutex_;
  uint64_t logged_scene_ = 0;
  std::set<Reason> logged_reasons_;
};

}  // namespace silhouette
