// SPDX-License-Identifier: Apache-2.0
// What sessions noticed about a cell, as the database keeps it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "db/store/store.h"
#include "db/store/suspects.h"

namespace silhouette {

void SetTime(absl::Time time, google::protobuf::Timestamp& stamp);

// Reads, changes and writes it. The database is open for writing.
absl::Status ChangeHistory(Database& database,
                           const std::function<void(storage::v1::CaptureHistory&)>& change);

// The beginning of the check that found nothing and was stored last, whatever the clock said
// before; absl::InfinitePast() without one.
absl::Time LastGoodCheck(const storage::v1::CaptureHistory& history);

// The latest capture time of all robot images; absl::InfinitePast() without any.
absl::StatusOr<absl::Time> LatestCapture(const Snapshot& snapshot);

// The captured configurations that are suspect, in order. One that was recaptured since is not.
absl::StatusOr<std::vector<ConfigurationNumber>> SuspectNumbers(const Snapshot& snapshot);

// How well the sentinels repeated in a view, over all checks that found nothing.
struct ViewRepeatability {
  std::string name;
  int sights = 0;
  // Camera pixels: root mean square of the background's shift, and the largest; NaN: not
  // known.
  double shift = 0;
  double greatest_shift = 0;
  // Mask pixels that differed, on the mean and at most.
  double mask_pixels = 0;
  int most_mask_pixels = 0;
  // The darkest and the brightest, as a factor to the first.
  double least_gain = 1;
  double greatest_gain = 1;
};

struct CaptureRepeatability {
  int checks = 0;
  int alarms = 0;
  // Root mean square and largest of the joint that differed most from where it was at first.
  double joint = 0;
  double greatest_joint = 0;
  std::vector<ViewRepeatability> views;
};

CaptureRepeatability RepeatabilityOf(const storage::v1::CaptureHistory& history,
                                     const storage::v1::CellDescription& cell);

}  // namespace silhouette
