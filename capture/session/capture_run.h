// CaptureRun: one run of a capture session, configuration by configuration.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "capture/capture_observer.h"
#include "capture/capture_plan.h"
#include "capture/capture_report.h"
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
  absl::Status CaptureAll();
  // Commits now unless the next configuration will be done before it is due.
  absl::Status CommitIfDue(absl::Time now);
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
  CaptureReport report_;
  int failures_in_a_row_ = 0;
  absl::Time last_commit_;
  absl::Duration last_cycle_;
};

}  // namespace silhouette
