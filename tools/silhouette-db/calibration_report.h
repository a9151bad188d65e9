// SPDX-License-Identifier: Apache-2.0
// What `silhouette-db calibration show` reports of a calibration.
#pragma once

#include <string>

#include "calib/camera/calibration.h"
#include "tools/silhouette-db/calibration_files/tested_calibration.h"

namespace silhouette {

// A calibration and what the robot images say of it.
struct CalibrationReport {
  const Database& database;
  uint64_t generation = 0;
  const Calibration& calibration;
  const storage::v1::CalibrationRecord& record;
  double margin = 0;
  const Contradictions& contradictions;
};

// Prints it as `format` says: text or json.
void Print(const CalibrationReport& report, const std::string& format);

}  // namespace silhouette
