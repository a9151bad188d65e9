// SPDX-License-Identifier: Apache-2.0
// How far the corners that are found in a rendered image are from where they really are.
#pragma once

#include <cmath>
#include <opencv2/core.hpp>
#include <optional>

#include "calib/detection/board_detector.h"
#include "tests/calib/detection/rendered_board.h"

namespace silhouette {

struct CornerErrors {
  size_t corners = 0;
  double rms = 0;    // per axis, pixels
  double worst = 0;  // pixels
  double chi2 = 0;   // per degree of freedom
};

inline CornerErrors ErrorsIn(const cv::Mat& image, const RenderedBoard& rendered,
                             const Board& board,
                             const std::optional<CameraModel>& lens = std::nullopt) {
  BoardDetector detector({board});
  CornerErrors errors;
  for (const DetectedTag& mark : detector.Detect(image, lens)) {
    if (!board.HasTag(mark.family, mark.tag)) continue;
    for (size_t i = 0; i < mark.corners.size(); ++i) {
      const double error =
          (mark.corners[i] - rendered.Corner(mark.tag, static_cast<int>(i))).norm();
      errors.rms += error * error / 2;
      errors.chi2 += error * error / (2 * mark.sigma * mark.sigma);
      errors.worst = std::max(errors.worst, error);
      ++errors.corners;
    }
  }
  errors.rms = std::sqrt(errors.rms / static_cast<double>(errors.corners));
  errors.chi2 /= static_cast<double>(errors.corners);
  return errors;
}

}  // namespace silhouette
