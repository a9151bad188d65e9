// What a run tells its user and its log, and asks its user.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/time/time.h"
#include "capture/session/capture_observer.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/session_log.h"

namespace silhouette {

class RunObserver {
 public:
  // `total`: configurations to be captured. `log` must outlive it.
  RunObserver(uint64_t total, SessionLog& log);

  // For the session; it refers to this.
  CaptureObserver Observer();

 private:
  void Say(const std::string& line);
  // Both ask who sits there; nobody does: end.
  AfterAlarm AskAfterAlarm(const std::string& why);
  bool AskWhetherRobotMayMove();

  const uint64_t total_;
  SessionLog& log_;
  const absl::Time begin_;
  std::optional<Progress> progress_;  // nothing to capture: none
};

}  // namespace silhouette
