// SPDX-License-Identifier: Apache-2.0
// The digest of a drawn robot: what was measured or drawn of it holds while its digest is the same.
#pragma once

#include <string>

#include "calib/robot/drawing/drawn_robot.h"

namespace silhouette {

// XXH3-128 as 32 hexadecimal digits, over all that decides what is drawn: joints, links, parts and
// views, in their order. Numbers are rounded to a billionth of their unit, so that compilers do not
// matter.
std::string DigestOf(const DrawnRobot& robot);

}  // namespace silhouette
