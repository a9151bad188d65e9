#include "capture/session/capture_session.h"

#include <utility>

#include "absl/status/status.h"
#include "capture/session/capture_run.h"
#include "capture/session/reference_images.h"
#include "db/status/status_macros.h"

namespace silhouette {

absl::StatusOr<CaptureSession> CaptureSession::Create(Database& database, const Travel& travel,
                                                      Robot& robot, CameraRig& rig,
                                                      const CaptureSettings& settings,
                                                      const SegmentationSettings& segmentation) {
  ASSIGN_OR_RETURN(CellRobot cell_robot, CellRobot::Create(database.cell(), robot));
  ASSIGN_OR_RETURN(CellCameras cameras, CellCameras::Create(database.cell(), rig));
  if (database.cell().segmentation() != Describe(segmentation)) {
    return absl::FailedPreconditionError(
        "the database was made with other segmentation settings; its robot images and those to "
        "come would not err in the same way");
  }
  ASSIGN_OR_RETURN(std::vector<Reference> references, ReadReferences(database));
  return CaptureSession({.database = &database,
                         .travel = &travel,
                         .robot = std::move(cell_robot),
                         .cameras = std::move(cameras),
                         .references = std::move(references),
                         .settings = settings,
                         .segmentation = segmentation});
}

CaptureSession::CaptureSession(SessionParts parts) : parts_(std::move(parts)) {}

CaptureReport CaptureSession::Run(const CapturePlan& plan, const std::string& program,
                                  const CaptureObserver& observer) {
  absl::StatusOr<RobotImageWriter> writer =
      parts_.database->Write(program, parts_.settings.commit_interval);
  if (!writer.ok()) {
    CaptureReport report;
    report.status = writer.status();
    report.planned = plan.captures.size();
    report.kept = plan.kept;
    return report;
  }
  return CaptureRun(parts_, *writer, plan, observer).Go();
}

}  // namespace silhouette
