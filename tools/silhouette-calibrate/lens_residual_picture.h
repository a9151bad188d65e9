// A camera's residuals over its image, for the eye: what should look like noise, and where no
// corner was seen.
#pragma once

#include "calib/intrinsics/solve_lenses.h"
#include "common/picture/picture.h"

namespace silhouette {

// Each residual as a line from its corner to where it was projected, 10, 100 or 500 times as long;
// fields of the image are darker the more corners they have, and white without any.
Picture ResidualPicture(const LensSolution& solution, size_t camera);

}  // namespace silhouette
