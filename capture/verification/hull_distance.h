// SPDX-License-Identifier: Apache-2.0
// HullDistance: how far two convex hulls are from each other.
#pragma once

#include <Eigen/Geometry>

namespace silhouette {

// Metres between the convex hulls of the columns of `a` and `b`, each in a frame of its own; 0:
// they touch, or cannot be told apart. `enough` stands for that and all that is farther.
//
// Never more than the truth: what is returned is the distance of two planes across one direction,
// between which no point of either hull is. Less than the truth by no more than a micrometre where
// hulls are up to metres large. GJK (Gilbert, Johnson, Keerthi 1988) finds the direction; FCL 0.7
// has it, too, and misses the distance of parallel faces by centimetres.
double HullDistance(const Eigen::Matrix3Xd& a, const Eigen::Isometry3d& base_from_a,
                    const Eigen::Matrix3Xd& b, const Eigen::Isometry3d& base_from_b, double enough);

}  // namespace silhouette
