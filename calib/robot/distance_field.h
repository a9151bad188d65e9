// SPDX-License-Identifier: Apache-2.0
// DistanceField: how far points are at most from a body made of closed meshes, or how deep inside
// it at least.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <span>
#include <vector>

#include "calib/robot/triangle_mesh.h"

namespace silhouette {

// Whether the mesh encloses a volume: every edge is passed as often in one direction as in the
// other, where vertices at one place are one vertex, and no triangle is there from both sides.
bool IsClosed(const TriangleMesh& mesh);

// Closed meshes, together of all triangles of a closed mesh: if some of its connected pieces are
// turned the other way, inside out or as hollows of others, those of either way; else the mesh.
// None: its pieces cannot be told apart.
std::vector<TriangleMesh> SolidsOf(const TriangleMesh& mesh);

// Samples on a lattice, taken from the meshes once. Cannot be changed once made; used by any number
// of threads.
class DistanceField {
 public:
  // Samples that a field has at most.
  static constexpr double kMostSamples = 4e6;

  // `meshes`: closed ones, at least one; the body is their union. `range`: how far around the
  // body's box there are samples. `step`: from one to the next; a body so large that it would have
  // more than kMostSamples has fewer. Metres. Throws std::invalid_argument if a mesh is not closed,
  // or range or step is not positive.
  DistanceField(std::span<const TriangleMesh> meshes, double range, double step);

  // The body's box.
  const Eigen::AlignedBox3d& box() const { return box_; }
  // From one sample to the next.
  double step() const { return step_; }

  // The distance of a point from the body, negative inside, or somewhat more: within `range` of the
  // body, and near its surface, by less than two steps. Never less.
  double AtMost(const Eigen::Vector3d& point) const;

  // The distance, or less: outside the body and within `range` of its box, by less than two steps.
  // Never more; where it is not positive, the point may be in the body.
  double AtLeast(const Eigen::Vector3d& point) const;

 private:
  // Samples around a point, or around the nearest one among the samples.
  struct Near;
  Near At(const Eigen::Vector3d& point) const;
  void Take(const TriangleMesh& mesh);
  Eigen::Vector3d PointOf(int x, int y, int z) const {
    return lower_ + step_ * Eigen::Vector3d(x, y, z);
  }
  size_t IndexOf(int x, int y, int z) const {
    return (static_cast<size_t>(z) * static_cast<size_t>(size_.y()) + static_cast<size_t>(y)) *
               static_cast<size_t>(size_.x()) +
           static_cast<size_t>(x);
  }
  // Of every sample, whether the mesh encloses it.
  std::vector<bool> Enclosed(const TriangleMesh& mesh) const;

  Eigen::AlignedBox3d box_;
  Eigen::Vector3d lower_;
  Eigen::Vector3i size_;
  double step_ = 0;
  std::vector<float> samples_;  // x fastest, then y; rounded up
};

}  // namespace silhouette
