// A joint that stands still, and where.
#pragma once

#include <string>

namespace silhouette {

struct FixedJoint {
  std::string name;
  double position = 0;  // radians; prismatic: metres
};

}  // namespace silhouette
