// SPDX-License-Identifier: Apache-2.0
// Joins the parts of WatchConfigurationSpace.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "clients/cpp/drawn_space.h"
#include "clients/cpp/space_map.h"
#include "silhouette/answers.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette::client {

// A complete update.
struct SpaceUpdate {
  v1::Basis basis = {};
  // Why every configuration is unknown; kUnspecified for a reason that this library does not know.
  std::optional<Reason> unknown = std::nullopt;
  // The first of a stream, or the first of another database, which may have the same generation.
  bool whole = false;
  uint64_t skipped_scenes = 0;
  uint64_t tiles_changed = 0;
  // The map after this update, regardless of `unknown`.
  std::shared_ptr<const SpaceMap> map = nullptr;
  // The scene's obstacles for a drawn robot; null if they are not sent, or `unknown`.
  std::shared_ptr<const DrawnSpace> drawn = nullptr;
};

// One stream, from its first part on. Not thread-safe.
class SpaceAssembly {
 public:
  // The update that `part` completes, if it does. Internal, with the fault, for malformed parts,
  // parts in a wrong order, and if updates are missing; the whole stream is then invalid.
  // ResourceExhausted for a grid that does not fit into memory.
  absl::StatusOr<std::optional<SpaceUpdate>> Add(const v1::WatchConfigurationSpaceResponse& part);

 private:
  absl::Status Begin(const v1::WatchConfigurationSpaceResponse& first);
  absl::Status TakeRobot(const v1::WatchConfigurationSpaceResponse& first);
  absl::Status TakePlanes(const v1::WatchConfigurationSpaceResponse& first);
  absl::Status Take(const v1::ConfigurationSpaceTile& message);

  std::optional<SpaceUpdate> begun_;          // an update whose last part has not come
  std::shared_ptr<SpaceMap> map_;             // what it makes
  std::vector<bool> came_;                    // which tiles came with it
  std::shared_ptr<const SpaceMap> last_;      // what the last complete update made
  uint64_t generation_ = 0;                   // of its database
  uint64_t last_scene_ = 0;                   // the newest one of which there was an update
  std::shared_ptr<const ServedRobot> robot_;  // null: none is drawn, or sent
};

}  // namespace silhouette::client
