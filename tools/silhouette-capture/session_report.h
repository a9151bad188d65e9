// SPDX-License-Identifier: Apache-2.0
// Writes the report of a database's capture sessions.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/picture/picture.h"
#include "db/store/store.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/session_facts.h"

namespace silhouette {

// Where the report of a database's variant is kept by default: beside its folder.
std::string DefaultReportFolder(const std::string& database, const std::string& variant);

// Writes report.html, report.json and the pictures into `folder`, which is made if it is not there.
// `log`: the story's file. Errors: those of reading the database and of writing files.
absl::StatusOr<SessionFacts> WriteSessionReport(const CellArguments& arguments,
                                                const std::string& cell_name,
                                                const Database& database, const std::string& log,
                                                const std::string& folder);

// The pictures of a report.

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
