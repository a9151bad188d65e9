// SPDX-License-Identifier: Apache-2.0
// Whether captured robot images show the robot where the cell's model and calibration have it.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

// A sentence with the mend for each view in whose captured robot images the robot is elsewhere: by
// the joint values of a few configurations, and first_look: least_overlap of the cell. None, too,
// where nothing is known: without the robot's model, camera models or captured images with their
// joint values. Errors of the database.
absl::StatusOr<std::vector<std::string>> MisplacedViews(const Cell& cell, const Database& database);

}  // namespace silhouette
