// SPDX-License-Identifier: Apache-2.0
// What a capture has to do: which configurations, in which order, how long it takes and how much
// room it needs. Made without moving anything.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/session/capture_settings.h"
#include "capture/session/travel.h"
#include "db/store/store.h"

namespace silhouette {

struct CaptureSelection {
  enum class Kind {
    kMissing,  // what has no robot image, or was excluded and no longer is
    kListed,   // those in `listed`, again
    kAll,      // everything, again
    kNothing,  // only the sentinels are visited
  };
  Kind kind = Kind::kMissing;
  std::vector<ConfigurationNumber> listed = {};
  // Whether the sentinels are recaptured and become the new baseline; so it is with kAll.
  bool new_sentinels = false;
  // Whether robot images that lie in a forbidden region now are replaced by excluded records.
  bool exclude_captured = false;
};

struct CapturePlan {
  // To be captured, in the order of travel.
  std::vector<ConfigurationNumber> captures;
  // In forbidden regions and not stored as excluded yet.
  std::vector<ConfigurationNumber> exclusions;
  // Whether sentinels that are known are forgotten; whether they are visited though there is
  // nothing to capture.
  bool new_sentinels = false;
  bool check_sentinels = false;
  // Configurations whose records stay as they are.
  uint64_t kept = 0;
  uint64_t kept_images = 0;  // of these: with a robot image
  // Estimates. The robot's way to the first configuration is not known.
  absl::Duration duration;
  uint64_t bytes = 0;  // that the database grows by, at most, raw images left out
  // Into how many parts the forbidden regions cut the grid. The robot captures the one it stands
  // in.
  int parts = 1;
};

// What a database has of a configuration.
enum class StoredRecord : uint8_t {
  kNone,
  kCaptured,
  kExcluded,
  kDamaged,  // there is one; it cannot be read
};

// By number; all are kNone if there is no database yet.
absl::StatusOr<std::vector<StoredRecord>> ReadRecords(const Database& database);
std::vector<StoredRecord> NoRecords(const ConfigurationGrid& grid);

// `travel` belongs to the grid of `cell`, `records` to that, too. A damaged record counts as
// captured. FailedPrecondition if robot images lie in a forbidden region and
// selection.exclude_captured is false: they would be called free, or be lost. InvalidArgument if
// `listed` names what is not in the grid, or a mask size is not valid.
absl::StatusOr<CapturePlan> PlanCapture(const storage::v1::CellDescription& cell,
                                        const Travel& travel,
                                        const std::vector<StoredRecord>& records,
                                        const CaptureSettings& settings,
                                        const CaptureSelection& selection);

}  // namespace silhouette
