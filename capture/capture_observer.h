// What long work in the cell tells, and asks, while it goes on.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace silhouette {

struct CaptureObserver {
  // Configurations, or sets of reference images, that are done with.
  std::function<void(uint64_t done)> progress = [](uint64_t) {};
  // Something worth a line happened.
  std::function<void(const std::string& line)> say = [](const std::string&) {};
  // Asked between two of them.
  std::function<bool()> stop_requested = [] { return false; };
};

}  // namespace silhouette
