// CaptureRun: one run of a capture session, configuration by configuration.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/session/capture_observer.h"
#include "capture/session/capture_plan.h"
#include "capture/session/capture_report.h"
#include "capture/session/sentinels.h"
#include "capture/session/session_parts.h"
#include "capture/session/visitor.h"

namespace silhouette {

// Goes once. What it is made from must outlive it.
class CaptureRun {
 public:
  CaptureRun(SessionParts& parts, RobotImageWriter& writer, const CapturePlan& plan,
             const CaptureObserver& observer);

  // All of it, as CaptureSession::Run says.
  CaptureReport Go();

 private:
  absl::Status Exclude();
  absl::Status CountSuspects();
  // The sentinels that are not known yet, then what is planned, with visits to the sentinels
  // before, between and after.
  absl::Status CaptureAll();
  // Whether to go on: nobody asked for a stop.
  absl::StatusOr<bool> CaptureInTurn(const std::vector<ConfigurationNumber>& numbers);
  // Whether to go on: all is as it was, or somebody says so.
  absl::StatusOr<bool> CheckSentinels();
  // Waits for lost devices.
  absl::StatusOr<Visit> VisitPatiently(ConfigurationNumber number);
  // Once. A robot that was lost does not move before somebody says that it may.
  absl::StatusOr<Visit> VisitOnce(ConfigurationNumber number);
  // Whether VisitPatiently ended because somebody did not want to wait for a lost device.
  bool StoppedWaiting(const absl::Status& status) const;
  // Commits now unless the next configuration will be done before it is due.
  absl::Status CommitIfDue(absl::Time now);
  absl::Status CheckDisk() const;
  // Not OK: the session ends. So do the others.
  absl::Status CaptureOne(ConfigurationNumber number);
  absl::Status CountMiss(const Visit& visit);
  absl::Status Store(ConfigurationNumber number, const Visit& visit);
  // Tells the robot to stop; returns `why`.
  absl::Status StopRobot(const absl::Status& why);

  SessionParts& parts_;
  RobotImageWriter& writer_;
  const CapturePlan& plan_;
  const CaptureObserver& observer_;
  Visitor visitor_;
  std::optional<Sentinels> sentinels_;
  CaptureReport report_;
  uint64_t done_ = 0;
  bool first_sights_ = false;  // the sentinels are being captured
  bool unchecked_ = false;     // something was captured since the sentinels were visited
  bool going_on_ = false;      // although they did not match
  bool robot_lost_ = false;    // and must not move by itself
  int failures_in_a_row_ = 0;
  absl::Time last_commit_;
  absl::Duration last_cycle_;
};

}  // namespace silhouette
