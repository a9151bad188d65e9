// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/lens_region.h"

namespace silhouette {

bool LensRegion::Contains(const Eigen::Vector2d& pixel) const {
  // How often a line from the pixel to the right crosses the contour.
  bool inside = false;
  for (size_t i = 1; i < contour.size(); ++i) {
    const Eigen::Vector2d& a = contour[i - 1];
    const Eigen::Vector2d& b = contour[i];
    if ((a.y() > pixel.y()) == (b.y() > pixel.y())) continue;
    const double share = (pixel.y() - a.y()) / (b.y() - a.y());
    if (pixel.x() < a.x() + share * (b.x() - a.x())) inside = !inside;
  }
  return inside;
}

}  // namespace silhouette
