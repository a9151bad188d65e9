// Waiting in a thread that may be asked to stop.
#pragma once

#include <stop_token>

#include "absl/time/time.h"

namespace silhouette {

// Waits so long, or until it is to stop.
void Pause(const std::stop_token& stop, absl::Duration time);

// How long to wait before a device that failed is asked again: twice as long each time.
class Backoff {
 public:
  Backoff(absl::Duration first, absl::Duration longest)
      : first_(first), longest_(longest), next_(first) {}

  absl::Duration Next();
  void Reset() { next_ = first_; }

 private:
  absl::Duration first_;
  absl::Duration longest_;
  absl::Duration next_;
};

}  // namespace silhouette
