// Publishes the configuration-space map of the default policy in a file that clients on the same
// machine map into their memory (clients/shared_map/layout.h).
#pragma once

#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "clients/shared_map/writer.h"
#include "server/scene/configuration_space.h"
#include "server/scene/scene_store.h"
#include "server/service/shared_map_file.h"

namespace silhouette {

// Used by one thread at a time.
class SharedMapWriter {
 public:
  // Makes the file; all is unknown, there is no scene. `max_age`: the server's own. Errors as
  // SharedMapFile's.
  static absl::StatusOr<std::unique_ptr<SharedMapWriter>> Create(
      SharedMapSettings settings, absl::Duration max_age,
      const std::shared_ptr<const ServedDatabase>& database, const Policy& policy);

  // Tells readers that the map is closed, and removes the file.
  ~SharedMapWriter();
  SharedMapWriter(const SharedMapWriter&) = delete;
  SharedMapWriter& operator=(const SharedMapWriter&) = delete;

  // What is so from now on. `blocked`: why all is unknown (BlockedReason), else kNone, and then
  // `space` is the map of served.scene under `policy`; tiles of it that are not ready are unknown.
  // Cells are told of if those of all tiles are ready, and the policy looks at any.
  // Another database than before gets a file of its own, and readers of the one before are told; if
  // it cannot be made they are told all the same, and the next call tries again. Moments must be of
  // SystemClock.
  absl::Status Publish(const Served& served, const Policy& policy, const ConfigurationSpace* space,
                       Reason blocked);

 private:
  SharedMapWriter(SharedMapSettings settings, absl::Duration max_age)
      : settings_(std::move(settings)), max_age_(max_age) {}

  absl::Status Begin(const std::shared_ptr<const ServedDatabase>& database, const Policy& policy);
  void Close(shared_map::Closed why);
  static shared_map::Cells CellsOf(const ConfigurationSpace& space, const Policy& policy);
  shared_map::Stamp StampOf(const Served& served, const Policy& policy, Reason blocked) const;

  const SharedMapSettings settings_;
  const absl::Duration max_age_;
  // What the file is of. Not kept alive: it is large.
  std::weak_ptr<const ServedDatabase> database_;
  std::unique_ptr<SharedMapFile> file_;
  std::optional<shared_map::Writer> writer_;
};

}  // namespace silhouette
