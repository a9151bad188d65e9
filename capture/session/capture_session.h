// SPDX-License-Identifier: Apache-2.0
// CaptureSession: drives the robot through the configurations of a plan and stores its image in
// every view.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "capture/devices/devices.h"
#include "capture/segmentation/settings.h"
#include "capture/session/capture_observer.h"
#include "capture/session/capture_plan.h"
#include "capture/session/capture_report.h"
#include "capture/session/capture_settings.h"
#include "capture/session/travel.h"
#include "capture/session/visitor.h"
#include "db/store/store.h"

namespace silhouette {

// What it is made from must outlive it.
class CaptureSession {
 public:
  // This many configurations in a row that are not reached end a session.
  static constexpr int kMostFailuresInARow = 3;

  // `database` is open for writing, `travel` belongs to its grid. InvalidArgument: robot or cameras
  // do not have the joints and views of the database's cell. FailedPrecondition: the database was
  // made with other segmentation settings. NotFound, DataLoss: see ReadReferences(). `expected`:
  // what the first images are compared with; nothing: they are not.
  static absl::StatusOr<CaptureSession> Create(Database& database, const Travel& travel,
                                               Robot& robot, CameraRig& rig,
                                               const CaptureSettings& settings,
                                               const SegmentationSettings& segmentation,
                                               std::optional<DrawnRobot> expected = {});

  // Captures what `plan` says. Whatever happens, what was captured until then is stored: the report
  // says how much, and a new plan resumes there. The images of the first look are not until it is
  // over: a session that ends before stores none, and says so; the next one looks again. `program`
  // goes into the provenance log.
  //
  // For each configuration: move (around forbidden regions), settle, measure, take a set of images,
  // measure again, difference, store. If all robot images that there are are to be replaced, they
  // are suspect until they are. A configuration where a joint is off by more than the
  // tolerance is not stored; it counts as failed. A device's error ends the session and stops the
  // robot. An operator who stops the robot (Cancelled) stops the session. FailedPrecondition: the
  // first images are not those of the robot (FirstLook); none of them is stored. Or only the
  // sentinels are to be visited, and none is known. With nothing to capture they are visited if
  // robot images were stored since they matched last.
  CaptureReport Run(const CapturePlan& plan, const std::string& program,
                    const CaptureObserver& observer = {});

 private:
  explicit CaptureSession(SessionParts parts);

  SessionParts parts_;
};

}  // namespace silhouette
