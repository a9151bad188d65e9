// SPDX-License-Identifier: Apache-2.0
// The calibration as the database stores it, and as the collision test uses it.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// The message holds the pose as a rotation vector, like mrcal's files: what it says comes back to
// within a rounding error.
storage::v1::CameraModel MessageOf(const CameraModel& camera);

// InvalidArgument, saying what is wrong, if the values are no camera.
absl::StatusOr<CameraModel> CameraFrom(const storage::v1::CameraModel& message);

// A calibration that CheckCalibration (db/store/store.h) lets pass. InvalidArgument if a camera is
// none.
absl::StatusOr<Calibration> CalibrationFrom(const storage::v1::Calibration& message);

// Tells calibrations apart: equal for the same cameras or matrices, whatever their record says. 16
// hexadecimal digits.
std::string FingerprintOf(const storage::v1::Calibration& message);

}  // namespace silhouette
