// SPDX-License-Identifier: Apache-2.0
// The log of a database's capture sessions: plain sentences with time stamps, appended session by
// session, so that it shows the next morning what happened at night.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/session/capture_observer.h"
#include "tools/program/progress.h"

namespace spdlog {
class logger;
}

namespace silhouette {

class SessionLog {
 public:
  // Appends to `file`. FailedPrecondition if it cannot be written.
  static absl::StatusOr<SessionLog> Open(const std::string& file);

  // A log that goes nowhere.
  SessionLog() = default;

  // A sentence; it is in the file when this returns. What cannot be written is lost, and nothing
  // else.
  void Write(const std::string& line);

  // The same now and then: not if the last such line is younger than five minutes.
  void WriteProgress(uint64_t done, uint64_t total, absl::Time begin);

  const std::string& file() const { return file_; }

 private:
  std::string file_;
  std::shared_ptr<spdlog::logger> logger_;
  absl::Time next_progress_ = absl::InfinitePast();
};

// Reports a run to its user and its log, and asks its user.

class RunObserver {
 public:
  // `total`: configurations to be captured. `log` must outlive it.
  RunObserver(uint64_t total, SessionLog& log);

  // For the session; it refers to this.
  CaptureObserver Observer();

 private:
  void Say(const std::string& line);
  // Both ask the operator; without a terminal: end.
  AfterAlarm AskAfterAlarm(const std::string& why);
  bool AskWhetherRobotMayMove();

  const uint64_t total_;
  SessionLog& log_;
  const absl::Time begin_;
  std::optional<Progress> progress_;  // nothing to capture: none
};

}  // namespace silhouette
