// SPDX-License-Identifier: Apache-2.0
// LensRegion: where in a camera's image its lens is known. Part of the pure core.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace silhouette {

struct LensRegion {
  // A closed line in pixels, integers at pixel centres: the first point again is its last. None:
  // the lens is known nowhere.
  std::vector<Eigen::Vector2d> contour{};
  // The standard deviation of a projection in the region is at most this, pixels. Nothing if
  // the region was found by another criterion, as mrcal's is.
  std::optional<double> sigma = std::nullopt;

  bool Contains(const Eigen::Vector2d& pixel) const;
};

}  // namespace silhouette
