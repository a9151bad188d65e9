// SPDX-License-Identifier: Apache-2.0
// The database of a cell, loaded as its cell file says.
#pragma once

#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/scene/served_database.h"
#include "tools/cell/cell.h"

namespace silhouette {

// The newest generation of the database that the cell names. The log reports what was loaded and
// its faults. InvalidArgument: the cell names no database. FailedPrecondition: the database belongs
// to another cell, or cannot serve the cell's policy; or its robot images are drawn from a model
// that is not verified, unless `unverified` permits it. Further errors: those of Database::Open,
// ServedDatabase::Load and of the cell file's masks of ignored pixels.
absl::StatusOr<std::shared_ptr<const ServedDatabase>> LoadDatabase(const Cell& cell,
                                                                   bool unverified);

// FailedPrecondition: no verdict from this database is free, because a margin of the cell is not
// known. The message names the cell file and the mend.
absl::Status MarginsKnown(const Cell& cell, const ServedDatabase& database);

}  // namespace silhouette
