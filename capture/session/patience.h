// Waiting for what may come back: a camera that was unplugged, a robot whose network is down.
#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "capture/session/capture_observer.h"
#include "capture/session/capture_report.h"

namespace silhouette {

// Does `work` again and again while it ends with Unavailable, for `retry` from its first end on, a
// few seconds apart; after each, `lost` is called. Says so, and when it is over; counts in
// `report`. Returns what the last `work` did. A stop that was asked for ends the waiting.
absl::Status WithPatience(absl::Duration retry, const std::function<absl::Status()>& work,
                          const std::function<void()>& lost, const CaptureObserver& observer,
                          CaptureReport& report);

}  // namespace silhouette
