// SPDX-License-Identifier: Apache-2.0
// The database of a cell, loaded as its cell file says.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/scene/served_database.h"
#include "tools/cell/cell.h"

namespace silhouette {

// The newest generation of the database in the folder `path`. The log reports what was loaded and
// its faults. FailedPrecondition: the database belongs to another cell, or cannot serve the cell's
// policy; or its robot images are drawn from a model that is not verified, unless `unverified`
// permits it. Further errors: those of Database::Open, ServedDatabase::Load and of the cell file's
// masks of ignored pixels.
absl::StatusOr<std::shared_ptr<const ServedDatabase>> LoadDatabase(const Cell& cell,
                                                                   const std::string& path,
                                                                   bool unverified);

}  // namespace silhouette
