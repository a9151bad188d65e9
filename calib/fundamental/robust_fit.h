// A fundamental matrix fitted to corners of which some are wrong.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/matrix_fit.h"

namespace silhouette {

struct RobustFit {
  MatrixFit fit;
  std::vector<bool> fits;     // per corner: whether it was believed
  std::vector<bool> roughly;  // whether it is right, though a lens may have moved it
  int believed = 0;
  // Root mean square of Sampson's distance of the believed corners; 1 if the corners' errors are
  // what they are said to be.
  double spread = 0;
};

// RANSAC over tags, then refined over the corners within four standard deviations - of what is
// found, if that is more than what the corners are said to have - until these stay the same. The
// same seed gives the same result. Nothing if there are less than eight corners or no eight of them
// agree with half of all.
std::optional<RobustFit> FitMatrix(std::span<const Correspondence> corners, uint32_t seed);

}  // namespace silhouette
