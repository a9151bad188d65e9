// SPDX-License-Identifier: Apache-2.0
// A calibration from files and into files, for `silhouette-db calibration`: camera models
// (calib/files/camera_file.h) or fundamental matrices
// (calib/files/calibration_session_file.h).
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// `inputs` is calibration.yaml (calib/files/calibration_session_file.h) or the folder that has it,
// one YAML file of fundamental matrices, one folder of camera models, or one camera model per view:
// FILE, named after its view, or VIEW=FILE. InvalidArgument or NotFound, naming file and view, for
// what is missing, unknown, there twice, not of its format or not for the views of `cell`.
absl::StatusOr<storage::v1::Calibration> ReadCalibration(const std::vector<std::string>& inputs,
                                                         const storage::v1::CellDescription& cell);

// Whether there are epipolar lines between the views: two cameras at different places, matrices of
// rank 2. InvalidArgument, naming the pair of views, if not.
absl::Status CheckLines(const Calibration& calibration, const storage::v1::CellDescription& cell);

// Writes what ReadCalibration reads: cameras into the folder `out`, one file per view, matrices
// into the file `out`; with calibration.yaml, or as such, where there is a record. Returns the
// files' paths. AlreadyExists if a file is there.
absl::StatusOr<std::vector<std::string>> WriteCalibration(
    const storage::v1::Calibration& calibration, const storage::v1::CellDescription& cell,
    const std::string& out);

}  // namespace silhouette
