// SPDX-License-Identifier: Apache-2.0
// Whether reference images show the robot.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/session/reference_images.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

struct RobotInReference {
  // Whose reference image shows the robot where the joint values that it reports have it: `moved`
  // is its outline.
  std::vector<MovedInView> views;
  // Why it was not looked for: its model, camera models or joint values are missing; else empty.
  std::string not_looked_for;
};

// A simulated robot is taken out of the cell. Errors are those of `taken` and the database.
absl::StatusOr<RobotInReference> FindRobot(const Cell& cell, const Database& database,
                                           const storage::v1::References& taken);

}  // namespace silhouette
