// SPDX-License-Identifier: Apache-2.0
// A joint of the robot and where it stands.
#pragma once

#include <string>

namespace silhouette {

struct JointPosition {
  std::string name;
  double position = 0;    // radians, metres
  double half_range = 0;  // it was nowhere farther from `position` while the images were taken
};

}  // namespace silhouette
