// What the three services share, and how they answer.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <functional>
#include <memory>
#include <utility>

#include "server/scene/scene_store.h"
#include "server/service/clearance_cache.h"
#include "server/service/map_keeper.h"
#include "server/service/region_log.h"
#include "server/service/scene_publisher.h"
#include "server/service/serving_settings.h"
#include "server/service/space_cache.h"
#include "server/service/verdict_counts.h"
#include "server/service/watch_hub.h"
#include "server/service/worker_pool.h"

namespace silhouette {

struct Serving {
  // `shared_map`: null if the settings name none.
  Serving(std::shared_ptr<const ServedDatabase> database, ServingSettings the_settings,
          std::unique_ptr<SharedMapWriter> shared_map)
      : settings(std::move(the_settings)),
        scenes(std::move(database)),
        publisher(settings, scenes),
        region_log(scenes, settings.clock),
        watches(scenes, settings.scene, settings.clock),
        map_keeper(std::make_shared<MapKeeper>(settings, scenes, spaces, std::move(shared_map))),
        watch_workers(settings.worker_threads, settings.worker_queue),
        workers(settings.worker_threads, settings.worker_queue) {
    scenes.SetTrust(settings.trust);
    if (map_keeper->needed()) watches.Add(map_keeper);
  }

  const ServingSettings settings;
  SceneStore scenes;
  ScenePublisher publisher;
  RegionLog region_log;
  SpaceCache spaces;
  ClearanceCache clearances;
  WatchHub watches;
  std::shared_ptr<MapKeeper> map_keeper;
  VerdictCounts verdicts;
  // Their tasks use the others. Watches have their own, so that they do not hold up scenes.
  WorkerPool watch_workers;
  WorkerPool workers;
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
