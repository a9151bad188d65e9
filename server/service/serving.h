// What the three services share, and how they answer.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <functional>
#include <memory>
#include <utility>

#include "capture/segmentation/settings.h"
#include "server/collision/policy.h"
#include "server/scene/clock.h"
#include "server/scene/scene_settings.h"
#include "server/scene/scene_store.h"
#include "server/service/clearance_cache.h"
#include "server/service/region_log.h"
#include "server/service/space_cache.h"
#include "server/service/worker_pool.h"

namespace silhouette {

struct ServingSettings {
  Policy policy;  // where a request names none
  // Instead of policy.preset the best one that the database can serve.
  bool choose_preset = false;
  SceneSettings scene;
  SegmentationSettings segmentation;
  Clock clock = SystemClock;
  int worker_threads = 2;
  // Tasks that may wait for a worker thread; more are turned away.
  size_t worker_queue = 256;
};

// The policy where a request names none, for requests that rest on `database`.
Policy DefaultPolicy(const ServingSettings& settings, const ServedDatabase& database);

struct Serving {
  Serving(std::shared_ptr<const ServedDatabase> database, ServingSettings the_settings)
      : settings(std::move(the_settings)),
        scenes(std::move(database)),
        region_log(scenes, settings.clock),
        workers(settings.worker_threads, settings.worker_queue) {}

  const ServingSettings settings;
  SceneStore scenes;
  RegionLog region_log;
  SpaceCache spaces;
  ClearanceCache clearances;
  WorkerPool workers;  // last: its tasks use the others
};

// Finishes a call with what `work` returns, at once.
grpc::ServerUnaryReactor* AnswerHere(grpc::CallbackServerContext* context,
                                     const std::function<grpc::Status()>& work);

// The same on a worker thread: for work that takes longer than a look-up. RESOURCE_EXHAUSTED if too
// much waits already.
grpc::ServerUnaryReactor* AnswerOnWorker(Serving& serving, grpc::CallbackServerContext* context,
                                         std::function<grpc::Status()> work);

// What `work` returns; an exception that leaves it is INTERNAL.
grpc::Status Guarded(const std::function<grpc::Status()>& work);

grpc::Status TooBusy();

}  // namespace silhouette
