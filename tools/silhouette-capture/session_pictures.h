// The pictures of a report.
#pragma once

#include <optional>

#include "absl/status/statusor.h"
#include "common/picture/picture.h"
#include "tools/silhouette-capture/session_facts.h"

namespace silhouette {

// How all configurations stand, over the two joints with the most values; of the others' values the
// worst standing is shown.
Picture CoveragePicture(const ConfigurationGrid& grid, const SessionFacts& facts);

// The sentinels in all views, as their cameras saw them where that was kept, with their masks.
absl::StatusOr<Picture> SentinelPicture(const Database& database, const Snapshot& snapshot,
                                        const SessionFacts& facts);

// Outliers and suspect robot images, at most 24. Nothing if there are none.
absl::StatusOr<std::optional<Picture>> OutlierPicture(const Database& database,
                                                      const Snapshot& snapshot,
                                                      const SessionFacts& facts);

// What the sentinels showed over time, a line per view. Nothing if they were not visited twice.
std::optional<Picture> HistoryPicture(const storage::v1::CellDescription& cell,
                                      const SessionFacts& facts);

}  // namespace silhouette
