// What SolveLenses found as .cameramodel files.
#pragma once

#include <string>

#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

// The pose is that before the group's reference, the first camera of the group. Models that
// CameraModel holds are written so that all of this project's programs read them, others as mrcal
// does.
std::string LensFileText(const SolvedCamera& camera);

}  // namespace silhouette
