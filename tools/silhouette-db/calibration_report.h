// SPDX-License-Identifier: Apache-2.0
// What `silhouette-db calibration` reports of a calibration.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera/calibration.h"
#include "tools/silhouette-db/calibration_files/tested_calibration.h"

namespace silhouette {

// Where the views' optical axes come nearest to each other, a point that all
// cameras look at. Nothing if they do not, or it is behind a camera.
std::optional<Eigen::Vector3d> PointLookedAt(const std::vector<CameraModel>& cameras);

// Metres that a mask pixel spans at `point`, across the view, in the direction in which it spans
// more; distortion is left out. `camera` has the mask's size.
double MetresPerPixel(const CameraModel& camera, const Eigen::Vector3d& point);

// x_b' F x_a = 0 in mask pixels with distortion taken out; of Frobenius norm 1. Both cameras have
// the masks' sizes.
Eigen::Matrix3d FundamentalMatrixOf(const CameraModel& a, const CameraModel& b);

// A calibration and what the robot images say of it.
struct CalibrationReport {
  const Database& database;
  uint64_t generation = 0;
  const Calibration& calibration;
  const storage::v1::CalibrationRecord& record;
  double margin = 0;
  const Contradictions& contradictions;
};

std::string TextOf(const CalibrationReport& report);
nlohmann::json JsonOf(const CalibrationReport& report);

}  // namespace silhouette
