// The cameras that Linux has drivers for.
#pragma once

#include <string>
#include <vector>

namespace silhouette {

struct V4l2Device {
  std::string device;  // e.g. /dev/video0
  std::string name;    // as its driver calls it
};

// By their numbers. A camera may have several devices, of which not all give images.
std::vector<V4l2Device> FindV4l2Devices();

}  // namespace silhouette
