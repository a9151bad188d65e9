// SPDX-License-Identifier: Apache-2.0
// What the three services share.
#pragma once

#include <grpcpp/impl/service_type.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "server/collision/verdict.h"
#include "server/scene/clock.h"
#include "server/scene/scene.h"
#include "server/scene/scene_store.h"
#include "server/service/clients.h"
#include "server/service/index_check.h"
#include "server/service/map_keeper.h"
#include "server/service/repeated_images.h"
#include "server/service/serving_settings.h"
#include "server/service/space_cache.h"
#include "server/service/watch_hub.h"
#include "server/service/watched_paths.h"
#include "server/service/worker_pool.h"

namespace silhouette {

// How many verdicts were returned, by state and reason.
// Thread-safe.
class VerdictCounts {
 public:
  void Add(State state, Reason reason, uint64_t verdicts = 1) {
    counts_[Place(state, reason)].fetch_add(verdicts, std::memory_order_relaxed);
  }
  void Add(const Verdict& verdict) { Add(verdict.state(), verdict.reason()); }

  // `visit(state, reason, verdicts)` for all that were returned at least once.
  template <typename Visit>
  void ForEach(const Visit& visit) const {
    for (size_t place = 0; place < counts_.size(); ++place) {
      const uint64_t verdicts = counts_[place].load(std::memory_order_relaxed);
      if (verdicts == 0) continue;
      visit(static_cast<State>(place / kReasons), static_cast<Reason>(place % kReasons), verdicts);
    }
  }

 private:
  static constexpr size_t kReasons = 32;  // more than there are
  static constexpr size_t kStates = 3;

  static size_t Place(State state, Reason reason) {
    return static_cast<size_t>(state) * kReasons + static_cast<size_t>(reason);
  }

  std::array<std::atomic<uint64_t>, kStates * kReasons> counts_{};
};

// Where scenes become what verdicts rest on, wherever they come from.
// Thread-safe.
class ScenePublisher {
 public:
  // Both must outlive it.
  ScenePublisher(const ServingSettings& settings, SceneStore& scenes)
      : settings_(settings), scenes_(scenes) {}

  // As SceneStore::Publish. Writes a line to the log when scenes have a new defect, and when they
  // have recovered.
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
  FaultLog<Reason> log_;
};

struct Serving {
  Serving(std::shared_ptr<const ServedDatabase> database, ServingSettings the_settings)
      : settings(std::move(the_settings)),
        scenes(std::move(database)),
        publisher(settings, scenes),
        repeated_images(settings.without_noise),
        watches(scenes, settings.scene, settings.clock),
        map_keeper(std::make_shared<MapKeeper>(settings, scenes, spaces)),
        index_check(settings, scenes, spaces),
        clients(settings.limits),
        watch_workers(PoolOf("watches", kBehindScenes)),
        workers(PoolOf("checks", kBehindScenes)),
        scene_workers(PoolOf("scenes", 0)) {
    scenes.SetTrust(settings.trust);
    if (map_keeper->needed()) watches.Add(map_keeper);
    index_check.Start();
  }

  // Records a change, or what may come often (AuditLog::NoteFirst), if changes are recorded. `who`:
  // CallerOf the call, or "server".
  void Audit(const std::string& who, const std::string& what, const std::string& detail) const {
    if (settings.audit != nullptr) settings.audit->Note(EntryOf(who, what, detail));
  }
  void AuditFirst(const std::string& who, const std::string& what,
                  const std::string& detail) const {
    if (settings.audit != nullptr) settings.audit->NoteFirst(EntryOf(who, what, detail));
  }

  // The services may end then: no task uses them any longer.
  void FinishTasks() {
    for (WorkerPool* pool : {&watch_workers, &workers, &scene_workers}) pool->Finish();
  }

  const ServingSettings settings;
  SceneStore scenes;
  ScenePublisher publisher;
  RepeatedImages repeated_images;
  SpaceCache spaces;
  ClearanceCache clearances;
  WatchedPaths watched_paths;
  WatchHub watches;
  std::shared_ptr<MapKeeper> map_keeper;
  IndexCheck index_check;
  VerdictCounts verdicts;
  Clients clients;
  // Their tasks use the others. Scenes and regions have their own, with more of the processors: no
  // check or watch holds them up.
  WorkerPool watch_workers;
  WorkerPool workers;
  WorkerPool scene_workers;

 private:
  static constexpr int kBehindScenes = 5;  // niceness

  WorkerPoolSettings PoolOf(const std::string& name, int nice) const;
  AuditEntry EntryOf(const std::string& who, const std::string& what,
                     const std::string& detail) const {
    const Moment now = settings.clock();
    return {.time = now.time, .running = now.running, .who = who, .what = what, .detail = detail};
  }
};

// The three services; `serving` must outlive them.
std::unique_ptr<grpc::Service> NewCollisionService(Serving& serving);
std::unique_ptr<grpc::Service> NewSceneService(Serving& serving);
std::unique_ptr<grpc::Service> NewDatabaseService(Serving& serving);

}  // namespace silhouette
