// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/arm.h"

#include <cmath>
#include <numbers>

namespace silhouette::paper {

std::string NameOf(Variant variant) { return variant == Variant::kPlanar ? "planar" : "spatial"; }

Spheres ArmAt(const ArmShape& shape, Variant variant, double q1, double q2) {
  using Eigen::Vector3d;
  std::array<Vector3d, 2> directions;
  if (variant == Variant::kPlanar) {
    directions = {Vector3d(std::cos(q1), 0, std::sin(q1)),
                  Vector3d(std::cos(q1 + q2), 0, std::sin(q1 + q2))};
  } else {
    directions = {Vector3d(std::cos(q1), std::sin(q1), 0),
                  Vector3d(std::cos(q1) * std::cos(q2), std::sin(q1) * std::cos(q2), std::sin(q2))};
  }
  Spheres spheres;
  Vector3d start = Vector3d::Zero();
  for (size_t link = 0; link < directions.size(); ++link) {
    const Vector3d end = start + shape.links[link] * directions[link];
    for (int i = 0; i < shape.spheres_per_link; ++i) {
      const double share = static_cast<double>(i) / (shape.spheres_per_link - 1);
      spheres.push_back({start + share * (end - start), shape.sphere_radius});
    }
    start = end;
  }
  return spheres;
}

ConfigurationGrid ArmGrid(int steps) {
  const auto joint = [&](const char* name) {
    return GridJoint{name, 0, 2 * std::numbers::pi, steps, true};
  };
  return ConfigurationGrid({joint("q1"), joint("q2")});
}

}  // namespace silhouette::paper
