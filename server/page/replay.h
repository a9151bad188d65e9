// SPDX-License-Identifier: Apache-2.0
// The moments of a recording (common/recording), each shown as the page shows the present.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/recording/recording.h"
#include "server/page/snapshot.h"
#include "server/scene/served_database.h"
#include "server/service/serving_settings.h"

namespace silhouette {

// Times are whole milliseconds since 1970; those of the recording are rounded up. Thread-safe.
class Replay {
 public:
  // `settings`: policy, scene, segmentation and joint_slides of the cell; the rest is not used.
  // Errors: those of Recording::Open and ServedDatabase::CanServe. FailedPrecondition: the
  // recording is empty, or of another cell or grid.
  static absl::StatusOr<std::unique_ptr<Replay>> Open(
      const std::string& path, std::shared_ptr<const ServedDatabase> database,
      const ServingSettings& settings);

  // From when to when it is, when scenes are recorded, and its stops.
  nlohmann::json TimeLine() const;

  // The snapshot of a moment, made by the code that makes those of the present, with a clock that
  // stands still there. Nothing is known where no scene is recorded, and where the server knew
  // nothing then: "error" if the moment cannot be made at all. "replay", where it is among the
  // scenes, comes with an error, too.
  nlohmann::json At(int64_t time, const SliceChoice& choice) const;

  const RecordingSummary& summary() const { return recording_->summary(); }

 private:
  Replay(std::unique_ptr<Recording> recording, std::shared_ptr<const ServedDatabase> database,
         ServingSettings settings);
  absl::StatusOr<RecordedMoment> MomentOf(absl::Time time) const;
  absl::StatusOr<nlohmann::json> Show(absl::Time time, RecordedMoment moment,
                                      const SliceChoice& choice) const;
  // Where the moment is among the scenes; `scene`: it has one.
  nlohmann::json PlaceOf(int64_t time, bool scene) const;

  const std::shared_ptr<const ServedDatabase> database_;
  const ServingSettings settings_;
  mutable std::mutex mutex_;  // of reading
  const std::unique_ptr<Recording> recording_;
};

}  // namespace silhouette
