// Spheres: what robot and obstacles are made of in the paper's simulation (§4.1).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace silhouette::paper {

struct Sphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0;
};

using Spheres = std::vector<Sphere>;

// The ideal collision test: whether any sphere of `a` and any of `b` have a point in common.
inline bool Touch(std::span<const Sphere> a, std::span<const Sphere> b) {
  for (const Sphere& each : a) {
    for (const Sphere& other : b) {
      const double reach = each.radius + other.radius;
      if ((each.centre - other.centre).squaredNorm() <= reach * reach) return true;
    }
  }
  return false;
}

}  // namespace silhouette::paper
