// SPDX-License-Identifier: Apache-2.0
// The server: three services, health and reflection on one address. The health service reports
// whether the database is undamaged as "silhouette.v1.Database", and whether the calibration is
// known to hold (CalibrationReason) as "silhouette.v1.Calibration", if that is checked from the
// start. It reports the server's own acquisition (LiveStatus), if there is one, as
// "silhouette.v1.Acquisition", and its cameras as "silhouette.v1.Camera/NAME". Changes are reported
// a moment later.
#pragma once

#include <grpcpp/server.h>

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/service/listener.h"
#include "server/service/metrics.h"
#include "server/service/serving.h"

namespace silhouette {

class Server {
 public:
  // Starts to listen; see CheckListenAddress for `address` and the errors, CheckGate,
  // CredentialsFor and GuardSocket for those of settings.gate, and Metrics for those of metrics.
  static absl::StatusOr<std::unique_ptr<Server>> Start(
      const std::string& address, std::shared_ptr<const ServedDatabase> database,
      ServingSettings settings);

  // Stops at once.
  ~Server();

  // The address that is listened on, with the port that was chosen.
  const std::string& address() const { return address_; }
  // The same of metrics; empty: there are none.
  const std::string& metrics_address() const;

  // Serves another generation; verdicts are unknown until the next scene.
  void ReplaceDatabase(std::shared_ptr<const ServedDatabase> database);

  // What is served now.
  std::shared_ptr<const ServedDatabase> database() const { return serving_.scenes.database(); }

  // For what shows people the state that is served (server/page), until Stop().
  Serving& serving() { return serving_; }

  // Publishes a scene made in this process, as PublishScene does. Errors: those of
  // SceneStore::Publish. Thread-safe.
  absl::StatusOr<SharedScene> Publish(Scene scene,
                                      const std::shared_ptr<const ServedDatabase>& database) {
    return serving_.publisher.Publish(std::move(scene), database);
  }

  // Runs `task` on a thread that takes scenes, however many of them wait; never, if those threads
  // hang. It must not throw. Thread-safe, until Stop().
  void RunWhereScenesAreTaken(std::function<void()> task) {
    serving_.scene_workers.Run(WorkerPool::kServer, /*bytes=*/0, std::move(task));
  }

  // What is known from now on of whether the calibration holds; null: it is not checked.
  void SetTrust(std::shared_ptr<const CalibrationTrust> trust);

  // Takes no more calls and waits for those in flight; what is not finished after `grace` is
  // cancelled, after a day at the latest. May be called once.
  void Stop(absl::Duration grace);

 private:
  Server(std::shared_ptr<const ServedDatabase> database, ServingSettings settings);

  Serving serving_;
  const std::array<std::unique_ptr<grpc::Service>, 3> services_;
  std::string address_;
  std::unique_ptr<Metrics> metrics_;  // null: there are none
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<Listener> listener_;  // null: no longer
  std::shared_ptr<Watcher> health_;
};

}  // namespace silhouette
