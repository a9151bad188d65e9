// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "calib/camera/camera_model.h"

namespace silhouette {

// The lens of CameraIntrinsics that is nearest to an equidistant one.
struct EquidistantFit {
  CameraIntrinsics intrinsics;
  double worst = 0;  // pixels: how far apart the two show a direction, at most, within the image
};

// `pinhole`: image, focal lengths and principal point; its distortion is not looked at. `k`: the
// equidistant lens, as OpenCV's fisheye and Kalibr's equi state it: what is seen at the angle a
// from the axis is shown at the distance a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) from it, in
// focal lengths. Throws std::invalid_argument, saying what could be done, if the image shows what
// is 85 degrees and more from the axis (a plane at z = 1 does not hold it), or the lens folds back
// before the image's corners.
EquidistantFit NearestToEquidistant(const CameraIntrinsics& pinhole,
                                    const std::array<double, 4>& k);

}  // namespace silhouette
