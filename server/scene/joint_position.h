// SPDX-License-Identifier: Apache-2.0
// A joint of the robot and where it stands.
#pragma once

#include <string>

namespace silhouette {

struct JointPosition {
  std::string name;
  double position = 0;  // radians, metres
};

}  // namespace silhouette
