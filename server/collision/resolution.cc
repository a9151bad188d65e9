// SPDX-License-Identifier: Apache-2.0
#include "server/collision/resolution.h"

#include <Eigen/SVD>
#include <algorithm>
#include <limits>

namespace silhouette {
namespace {

constexpr double kShellPixels = 1.5;
// What of a ball is certain: voxels of a third of its radius take the rest.
constexpr double kRadiusPerShell = 0.8;
constexpr double kStep = 1e-4;  // metres

// The length that looks shortest of all that fill a pixel, at a point; 0 where it is not seen.
double MetresPerPixel(const CameraModel& camera, const Eigen::Vector3d& point) {
  const auto pixel = camera.Project(point);
  if (!pixel || !camera.Contains(*pixel)) return 0;
  Eigen::Matrix<double, 2, 3> derivative;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
    const auto before = camera.Project(point - step);
    const auto behind = camera.Project(point + step);
    if (!before || !behind) return 0;
    derivative.col(axis) = (*behind - *before) / (2 * kStep);
  }
  const double least =
      Eigen::JacobiSVD<Eigen::Matrix<double, 2, 3>>(derivative).singularValues()[1];
  return least > 0 ? 1 / least : 0;
}

// Of the shell, what the masks are to blame for.
double ShellOfMasks(const ResolutionInput& input) {
  double coarsest = 0;
  for (const CameraModel& camera : input.cameras) {
    coarsest = std::max(coarsest, MetresPerPixel(camera, input.workspace.center()));
  }
  return (kShellPixels + 2 * input.margin) * coarsest;
}

}  // namespace

double ResolvableObstacle(const ResolutionInput& input) {
  const double of_masks = ShellOfMasks(input);
  return of_masks > 0 ? kRadiusPerShell * (of_masks + input.model_tolerance) : 0;
}

double MaskScaleFor(const ResolutionInput& input, double least_obstacle) {
  const double room = least_obstacle / kRadiusPerShell - input.model_tolerance;
  return room > 0 ? ShellOfMasks(input) / room : std::numeric_limits<double>::infinity();
}

}  // namespace silhouette
