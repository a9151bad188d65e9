// SPDX-License-Identifier: Apache-2.0
// The trials of `silhouette-experiments calibration`. Each takes a seed and measures some of the
// figures; the same seed gives the same figures, but for times.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "tools/silhouette-experiments/calibration/figures.h"

namespace silhouette::calibration_experiment {

// corner_px: tags in rendered images, with noise and blur; the detector does not know the lens.
Figures MeasureCorners(uint64_t seed);

// roundtrip_px: camera models to text and back.
absl::StatusOr<Figures> MeasureRoundTrip(uint64_t seed);

// workspace_px, chi2_per_dof, epipolar_px, weak_epipolar_px, band_misses, seconds: four cameras and
// 80 boards, calibrated several times with other places of the boards and other noise. chi2_per_dof
// is over all, workspace_px and seconds are the greatest, the others those of the first.
absl::StatusOr<Figures> MeasureLenses(uint64_t seed, int calibrations);

// flange_mm, flange_deg, workspace_mm: a tag on the flange in 30 poses.
absl::StatusOr<Figures> MeasureFlange(uint64_t seed);

}  // namespace silhouette::calibration_experiment
