// SPDX-License-Identifier: Apache-2.0
// The robot of the paper's simulation: two links, each of equidistant spheres (§4.1, Figure 6).
//
// Its base is the origin, z is up; at joint values 0 both links point along +x. A plain value.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "db/mask/configuration_grid.h"

namespace silhouette::paper {

// Robot and obstacles are made of spheres.
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

enum class Variant {
  // Both axes are parallel to y, the arm moves in the x-z plane; positive values lift the links.
  // The second value counts from the first link's direction.
  kPlanar,
  // The first axis is z; the first link stays level. The second joint pitches the second link:
  // positive values lift it.
  kSpatial,
};

std::string NameOf(Variant variant);

struct ArmShape {
  std::array<double, 2> links{0.45, 0.45};  // lengths
  int spheres_per_link = 5;                 // at least 2; the first and last are at the link's ends
  double sphere_radius = 0.07;
};

// The spheres of both links, from the base outward, at joint values q1, q2 in radians.
Spheres ArmAt(const ArmShape& shape, Variant variant, double q1, double q2);

// Two continuous joints of `steps` values each, from 0.
ConfigurationGrid ArmGrid(int steps);

}  // namespace silhouette::paper
