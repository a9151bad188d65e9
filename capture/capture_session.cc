#include "capture/capture_session.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "capture/reference_images.h"
#include "capture/segmentation/difference.h"

namespace silhouette {

absl::StatusOr<CaptureSession> CaptureSession::Create(Database& database, const Travel& travel,
                                                      Robot& robot, CameraRig& rig,
                                                      const CaptureSettings& settings,
                                                      const SegmentationSettings& segmentation) {
  absl::StatusOr<CellRobot> cell_robot = CellRobot::Create(database.cell(), robot);
  if (!cell_robot.ok()) return cell_robot.status();
  absl::StatusOr<CellCameras> cameras = CellCameras::Create(database.cell(), rig);
  if (!cameras.ok()) return cameras.status();
  if (database.cell().segmentation() != Describe(segmentation)) {
    return absl::FailedPreconditionError(
        "the database was made with other segmentation settings; its robot images and those to "
        "come would not err in the same way");
  }
  absl::StatusOr<std::vector<Reference>> references = ReadReferences(database);
  if (!references.ok()) return references.status();
  return CaptureSession(database, travel, *std::move(cell_robot), *std::move(cameras),
                        *std::move(references), settings, segmentation);
}

CaptureSession::CaptureSession(Database& database, const Travel& travel, CellRobot robot,
                               CellCameras cameras, std::vector<Reference> references,
                               CaptureSettings settings, SegmentationSettings segmentation)
    : database_(&database),
      travel_(&travel),
      robot_(std::move(robot)),
      cameras_(std::move(cameras)),
      references_(std::move(references)),
      settings_(std::move(settings)),
      segmentation_(segmentation) {}

// One run of a session.
class CaptureSession::Runner {
 public:
  Runner(CaptureSession& session, RobotImageWriter& writer, const CapturePlan& plan,
         const CaptureObserver& observer)
      : session_(session), writer_(writer), plan_(plan), observer_(observer) {
    report_.planned = plan.captures.size();
    report_.kept = plan.kept;
    for (const storage::v1::View& view : session.database_->cell().views()) {
      report_.views.push_back({.name = view.name()});
    }
  }

  CaptureReport Finish() {
    const absl::Time begin = absl::Now();
    report_.status = Exclude();
    if (report_.status.ok()) report_.status = CaptureAll();
    const absl::Status committed = writer_.Commit();
    if (report_.status.ok()) report_.status = committed;
    // Exclusions are written first.
    report_.excluded = std::min<uint64_t>(writer_.committed(), plan_.exclusions.size());
    report_.captured = writer_.committed() - report_.excluded;
    report_.duration = absl::Now() - begin;
    return std::move(report_);
  }

 private:
  // Where the robot was when its images were taken.
  struct Capture {
    std::vector<double> measured;
    ImageSet images;
  };

  absl::Status Exclude() {
    for (const ConfigurationNumber number : plan_.exclusions) {
      RobotImage image;
      image.number = number;
      image.excluded = true;
      image.captured = absl::Now();
      if (absl::Status status = writer_.Put(image, /*replace=*/true); !status.ok()) return status;
    }
    last_commit_ = absl::Now();
    return writer_.Commit();
  }

  absl::Status CaptureAll() {
    uint64_t done = 0;
    for (const ConfigurationNumber number : plan_.captures) {
      if (observer_.stop_requested()) {
        report_.stopped = true;
        return absl::OkStatus();
      }
      const absl::Time begin = absl::Now();
      if (absl::Status status = CommitIfDue(begin); !status.ok()) return status;
      if (absl::Status status = CaptureOne(number); !status.ok()) return status;
      last_cycle_ = absl::Now() - begin;
      observer_.progress(++done);
    }
    return absl::OkStatus();
  }

  // The writer commits at the next Put(); not later than commit_interval after the last commit.
  absl::Status CommitIfDue(absl::Time now) {
    if (now + last_cycle_ - last_commit_ < session_.settings_.commit_interval) {
      return absl::OkStatus();
    }
    last_commit_ = now;
    return writer_.Commit();
  }

  // Not OK: the session ends.
  absl::Status CaptureOne(ConfigurationNumber number) {
    const absl::StatusOr<bool> there = Go(number);
    if (!there.ok()) return StopRobot(there.status());
    if (!*there) return absl::OkStatus();
    absl::StatusOr<std::optional<Capture>> capture = TakeImages(number);
    if (!capture.ok()) return StopRobot(capture.status());
    if (!capture->has_value()) return absl::OkStatus();
    return Store(number, **capture);
  }

  // Whether the robot is there; false: there is no way.
  absl::StatusOr<bool> Go(ConfigurationNumber number) {
    absl::StatusOr<std::vector<Configuration>> route;
    if (at_) {
      route = session_.travel_->Route(*at_, number);
    } else {
      absl::StatusOr<std::vector<double>> here = session_.robot_.Measure();
      if (!here.ok()) return here.status();
      here->resize(static_cast<size_t>(session_.travel_->grid().dimensions()));
      route = session_.travel_->RouteFrom(*here, number);
      if (!route.ok() && session_.travel_->regions().At(*here)) return route.status();
    }
    if (!route.ok()) {
      if (report_.unreachable++ == 0) {
        observer_.say(absl::StrCat("configuration ", number, ": ", route.status().message()));
      }
      return false;
    }
    at_.reset();
    for (const Configuration& place : *route) {
      if (absl::Status status = session_.robot_.MoveTo(place); !status.ok()) return status;
    }
    return true;
  }

  // Nothing if the robot is not where it should be.
  absl::StatusOr<std::optional<Capture>> TakeImages(ConfigurationNumber number) {
    const std::vector<double> commanded =
        session_.robot_.Commanded(session_.travel_->grid().At(number));
    Capture capture;
    double deviation = 0;
    for (int attempt = 0; attempt < 2; ++attempt) {  // some robots take longer to settle
      absl::SleepFor(session_.settings_.settle);
      absl::StatusOr<std::vector<double>> measured = session_.robot_.Measure();
      if (!measured.ok()) return measured.status();
      capture.measured = *std::move(measured);
      deviation = session_.robot_.Deviation(commanded, capture.measured);
      if (deviation <= session_.settings_.joint_tolerance) break;
    }
    if (deviation > session_.settings_.joint_tolerance) return Failed(number, deviation);
    absl::StatusOr<ImageSet> images = session_.cameras_.Grab(observer_.say);
    if (!images.ok()) return images.status();
    capture.images = *std::move(images);
    const absl::StatusOr<std::vector<double>> after = session_.robot_.Measure();
    if (!after.ok()) return after.status();
    deviation = std::max(deviation, session_.robot_.Deviation(commanded, *after));
    if (deviation > session_.settings_.joint_tolerance) return Failed(number, deviation);
    report_.max_deviation = std::max(report_.max_deviation, deviation);
    failures_in_a_row_ = 0;
    at_ = number;
    return capture;
  }

  absl::StatusOr<std::optional<Capture>> Failed(ConfigurationNumber number, double deviation) {
    ++report_.failed;
    const std::string what =
        absl::StrFormat("configuration %d: a joint is off by %.4f, more than %.4f", number,
                        deviation, session_.settings_.joint_tolerance);
    if (++failures_in_a_row_ == kMostFailuresInARow) {
      return absl::AbortedError(absl::StrCat("the robot is not where it should be, ",
                                             kMostFailuresInARow, " times in a row; ", what));
    }
    observer_.say(what);
    return std::nullopt;
  }

  absl::Status Store(ConfigurationNumber number, const Capture& capture) {
    RobotImage image;
    image.number = number;
    image.captured = capture.images.captured;
    image.commanded = session_.robot_.Commanded(session_.travel_->grid().At(number));
    image.measured = capture.measured;
    for (size_t v = 0; v < report_.views.size(); ++v) {
      image.masks.push_back(Difference(capture.images.images[v], session_.references_[v],
                                       session_.segmentation_,
                                       session_.database_->mask_sizes()[v]));
      report_.views[v].Add(image.masks.back());
    }
    return writer_.Put(image, /*replace=*/true);
  }

  absl::Status StopRobot(const absl::Status& why) {
    const absl::Status stopped = session_.robot_.Stop();
    if (!stopped.ok()) {
      observer_.say(absl::StrCat("the robot could not be told to stop: ", stopped.message()));
    }
    return why;
  }

  CaptureSession& session_;
  RobotImageWriter& writer_;
  const CapturePlan& plan_;
  const CaptureObserver& observer_;
  CaptureReport report_;
  // Where the robot stands; nothing if that is not known for sure.
  std::optional<ConfigurationNumber> at_;
  int failures_in_a_row_ = 0;
  absl::Time last_commit_ = absl::Now();
  absl::Duration last_cycle_;
};

CaptureReport CaptureSession::Run(const CapturePlan& plan, const std::string& program,
                                  const CaptureObserver& observer) {
  absl::StatusOr<RobotImageWriter> writer = database_->Write(program, settings_.commit_interval);
  if (!writer.ok()) {
    CaptureReport report;
    report.status = writer.status();
    report.planned = plan.captures.size();
    report.kept = plan.kept;
    return report;
  }
  return Runner(*this, *writer, plan, observer).Finish();
}

}  // namespace silhouette
