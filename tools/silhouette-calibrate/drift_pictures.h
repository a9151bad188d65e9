// Pictures of how a camera moved.
#pragma once

#include "common/picture/picture.h"
#include "tools/silhouette-calibrate/tag_drift.h"

namespace silhouette {

// Arrows from where corners were to where they are, lengthened so that they can be seen.
Picture PaintDrift(const ViewDrift& drift, const ViewSizes& sizes, double limit_mask);

}  // namespace silhouette
