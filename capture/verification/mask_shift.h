// SPDX-License-Identifier: Apache-2.0
// By how much a mask is shifted against another.
#pragma once

#include <Eigen/Core>

#include "db/mask/mask.h"

namespace silhouette {

// Of `a` against `b`, pixels to the right and down, up to about 6 in each: the whole pixels at
// which they differ least, and what their rims say beyond. Both are of one size. 0 if one of them
// is empty.
Eigen::Vector2d ShiftOf(const Mask& a, const Mask& b);

}  // namespace silhouette
