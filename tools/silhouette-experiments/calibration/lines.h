// How true the epipolar lines of a calibration are.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/camera/camera_model.h"
#include "tools/silhouette-experiments/calibration/figures.h"
#include "tools/silhouette-experiments/calibration/rig.h"

namespace silhouette::calibration_experiment {

// Adds epipolar_px: corners that were not calibrated with, exactly where they are, and how far they
// are from their lines in images without distortion. `models`: as calibrated, one per camera of the
// rig, in any common frame.
void MeasureLines(const Rig& rig, const std::vector<CameraModel>& models, uint64_t seed,
                  Figures& figures);

// Adds weak_epipolar_px: the same for matrices straight from the corners of a session of `boards`
// places with noise of `sigma` pixels, by cameras like those of the rig whose lenses do not bow
// lines. Pairs of views with too few corners for any matrix are left out.
void MeasureWeakLines(const Rig& rig, size_t boards, double sigma, uint64_t seed, Figures& figures);

// Adds band_misses: points of the workspace whose true pixels, in masks, the bands say do not show
// the same.
void MeasureBands(const Rig& rig, const std::vector<CameraModel>& models, uint64_t seed,
                  Figures& figures);

}  // namespace silhouette::calibration_experiment
