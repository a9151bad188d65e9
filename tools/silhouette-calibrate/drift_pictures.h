// Pictures of how a camera moved.
#pragma once

#include "calib/fundamental/tag_drift.h"
#include "common/picture/picture.h"

namespace silhouette {

// Arrows from where corners were to where they are, lengthened so that they can be seen.
Picture PaintDrift(const ViewDrift& drift, const ViewSizes& sizes, double limit_mask);

}  // namespace silhouette
