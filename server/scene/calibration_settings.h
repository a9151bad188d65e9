// How far a calibration is trusted.
#pragma once

namespace silhouette {

struct CalibrationSettings {
  // Pixels of the masks by which every pixel's square is widened on all sides before epipolar lines
  // are drawn through it: for the error of the calibration.
  double margin = 0.25;
};

}  // namespace silhouette
