// SPDX-License-Identifier: Apache-2.0
// What the three services share, and how they answer.
#pragma once

#include <grpcpp/impl/service_type.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/collision/verdict.h"
#include "server/scene/clock.h"
#include "server/scene/scene.h"
#include "server/scene/scene_store.h"
#include "server/service/index_check.h"
#include "server/service/map_keeper.h"
#include "server/service/serving_settings.h"
#include "server/service/space_cache.h"
#include "server/service/watch_hub.h"

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

// Threads for the work that must not block gRPC's own.
class WorkerPool {
 public:
  // `threads` at least 1; `queue`: how many tasks may wait for a thread.
  WorkerPool(int threads, size_t queue);
  // Finishes all tasks, the waiting ones too.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Runs the task some time later; false, and it will not run, if the queue is full. The task must
  // not throw. May be called from any thread.
  bool Run(std::function<void()> task);

 private:
  void Work();

  const size_t queue_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;
  bool closing_ = false;
  std::vector<std::thread> threads_;
};

struct Serving {
  Serving(std::shared_ptr<const ServedDatabase> database, ServingSettings the_settings)
      : settings(std::move(the_settings)),
        scenes(std::move(database)),
        publisher(settings, scenes),
        watches(scenes, settings.scene, settings.clock),
        map_keeper(std::make_shared<MapKeeper>(settings, scenes, spaces)),
        index_check(settings, scenes, spaces),
        watch_workers(settings.worker_threads, settings.worker_queue),
        workers(settings.worker_threads, settings.worker_queue) {
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

  const ServingSettings settings;
  SceneStore scenes;
  ScenePublisher publisher;
  SpaceCache spaces;
  ClearanceCache clearances;
  WatchHub watches;
  std::shared_ptr<MapKeeper> map_keeper;
  IndexCheck index_check;
  VerdictCounts verdicts;
  // Their tasks use the others. Watches have their own, so that they do not hold up scenes.
  WorkerPool watch_workers;
  WorkerPool workers;

 private:
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

// Finishes a call with what `work` returns, at once.
grpc::ServerUnaryReactor* AnswerHere(grpc::CallbackServerContext* context,
                                     const std::function<absl::Status()>& work);

// The same on a worker thread: for work that takes longer than a look-up. RESOURCE_EXHAUSTED if too
// much waits already.
grpc::ServerUnaryReactor* AnswerOnWorker(Serving& serving, grpc::CallbackServerContext* context,
                                         std::function<absl::Status()> work);

// What `work` returns; an exception that leaves it is Internal.
absl::Status Guarded(const std::function<absl::Status()>& work);

absl::Status TooBusy();

grpc::Status ToGrpc(const absl::Status& status);

}  // namespace silhouette
