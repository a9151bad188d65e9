// A calibration that was found, for an experiment in the simulated cell.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "db/store/store.h"

namespace silhouette {

// `path`: what ReadCalibration (tools/silhouette-db/calibration_files/calibration_files.h) reads.
// `margin`: as in the cell file's `calibration`. As for `silhouette-db calibration import`, it must
// be for the database's views, and the robot images must not contradict it: InvalidArgument,
// NotFound or FailedPrecondition if not.
absl::StatusOr<Calibration> FoundCalibration(const std::string& path, const Database& database,
                                             double margin);

}  // namespace silhouette
