// Single corners, poses of the robot and surveyed places that do not fit the rest.
#pragma once

#include "absl/status/status.h"
#include "calib/poses/pose_bundle.h"

namespace silhouette {

// Marks anew what is too far off (BundleCorner::used, BundlePose::left_out), measured by how far
// off its like is. Returns whether anything changed.
bool MarkOutliers(Bundle& bundle);

// FailedPrecondition if so much was left out that nothing can be called the rest.
absl::Status CheckOutliers(const Bundle& bundle);

}  // namespace silhouette
