// How large a length can look in an image. Part of the pure core.
#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "calib/camera/camera_model.h"

namespace silhouette {

// The largest distance in the image, in pixels, that a metre between two near points of `box` can
// have, as far as the image shows the box: from the largest singular value of the projection's
// derivative, on a lattice of points and at the point nearest to the camera. 0 if the image shows
// nothing of the box; nothing if the camera is in the box, or on its rim.
std::optional<double> PixelsPerMetre(const CameraModel& camera, const Eigen::AlignedBox3d& box);

}  // namespace silhouette
