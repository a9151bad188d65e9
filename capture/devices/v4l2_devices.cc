#include "capture/devices/v4l2_devices.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace silhouette {

std::vector<V4l2Device> FindV4l2Devices() {
  namespace fs = std::filesystem;
  std::vector<V4l2Device> found;
  std::error_code error;
  for (fs::directory_iterator at("/sys/class/video4linux", error), end; !error && at != end;
       at.increment(error)) {
    const std::string node = at->path().filename().string();
    if (!node.starts_with("video")) continue;
    V4l2Device device{.device = "/dev/" + node, .name = ""};
    std::ifstream in(at->path() / "name");
    std::getline(in, device.name);
    found.push_back(std::move(device));
  }
  std::sort(found.begin(), found.end(), [](const V4l2Device& a, const V4l2Device& b) {
    return std::pair(a.device.size(), a.device) < std::pair(b.device.size(), b.device);
  });
  return found;
}

}  // namespace silhouette
