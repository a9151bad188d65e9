#include "calib/camera/pixels_per_metre.h"

#include <Eigen/SVD>
#include <algorithm>

namespace silhouette {
namespace {

constexpr int kLattice = 24;     // points along each edge of the box, less one
constexpr double kStep = 1e-5;   // metres
constexpr double kBeyond = 1.5;  // pixels: points this far outside the image count, too

// 0 where the image does not show the point.
double ScaleAt(const CameraModel& camera, const Eigen::Vector3d& point) {
  const auto pixel = camera.Project(point);
  const CameraIntrinsics& in = camera.intrinsics();
  if (!pixel || pixel->x() < -0.5 - kBeyond || pixel->x() > in.width - 0.5 + kBeyond ||
      pixel->y() < -0.5 - kBeyond || pixel->y() > in.height - 0.5 + kBeyond) {
    return 0;
  }
  Eigen::Matrix<double, 2, 3> derivative;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
    const auto before = camera.Project(point - step);
    const auto after = camera.Project(point + step);
    if (!before || !after) return 0;
    derivative.col(axis) = (*after - *before) / (2 * kStep);
  }
  return Eigen::JacobiSVD<Eigen::Matrix<double, 2, 3>>(derivative).singularValues()[0];
}

}  // namespace

std::optional<double> PixelsPerMetre(const CameraModel& camera, const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d centre = camera.Centre();
  const Eigen::Vector3d nearest = centre.cwiseMax(box.min()).cwiseMin(box.max());
  if ((nearest - centre).norm() < 1e-3) return std::nullopt;
  double greatest = ScaleAt(camera, nearest);
  for (int x = 0; x <= kLattice; ++x) {
    for (int y = 0; y <= kLattice; ++y) {
      for (int z = 0; z <= kLattice; ++z) {
        const Eigen::Vector3d share = Eigen::Vector3d(x, y, z) / kLattice;
        const Eigen::Vector3d point = box.min() + share.cwiseProduct(box.sizes());
        greatest = std::max(greatest, ScaleAt(camera, point));
      }
    }
  }
  return greatest;
}

}  // namespace silhouette
