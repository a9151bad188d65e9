// SPDX-License-Identifier: Apache-2.0
// Whether reference images show the robot.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/session/reference_images.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

// The views whose reference image shows the robot where the joint values that it reports have it:
// `moved` is its outline. Empty, and a line on stderr if that is worth one, if it is not known
// where the robot would be: without its model, camera models or joint values. A simulated robot is
// taken out of the cell. Errors are those of `taken` and the database.
absl::StatusOr<std::vector<MovedInView>> FindRobot(const Cell& cell, const Database& database,
                                                   const storage::v1::References& taken);

}  // namespace silhouette
