#include "capture/session/capture_run.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/capture_session.h"
#include "capture/segmentation/difference.h"

namespace silhouette {

CaptureRun::CaptureRun(SessionParts& parts, RobotImageWriter& writer, const CapturePlan& plan,
                       const CaptureObserver& observer)
    : parts_(parts),
      writer_(writer),
      plan_(plan),
      observer_(observer),
      visitor_(parts, observer.say),
      last_commit_(absl::Now()) {
  report_.planned = plan.captures.size();
  report_.kept = plan.kept;
  for (const storage::v1::View& view : parts.database->cell().views()) {
    report_.views.push_back({.name = view.name()});
  }
}

CaptureReport CaptureRun::Go() {
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

absl::Status CaptureRun::Exclude() {
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

absl::Status CaptureRun::CaptureAll() {
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
absl::Status CaptureRun::CommitIfDue(absl::Time now) {
  if (now + last_cycle_ - last_commit_ < parts_.settings.commit_interval) return absl::OkStatus();
  last_commit_ = now;
  return writer_.Commit();
}

absl::Status CaptureRun::CaptureOne(ConfigurationNumber number) {
  const absl::StatusOr<Visit> visit = visitor_.Go(number);
  if (!visit.ok()) return StopRobot(visit.status());
  switch (visit->outcome) {
    case Visit::Outcome::kTaken:
      return Store(number, *visit);
    case Visit::Outcome::kUnreachable:
      if (report_.unreachable++ == 0) observer_.say(visit->why);
      return absl::OkStatus();
    case Visit::Outcome::kMissed:
      break;
  }
  return CountMiss(*visit);
}

absl::Status CaptureRun::CountMiss(const Visit& visit) {
  ++report_.failed;
  if (++failures_in_a_row_ == CaptureSession::kMostFailuresInARow) {
    return StopRobot(absl::AbortedError(absl::StrCat("the robot is not where it should be, ",
                                                     CaptureSession::kMostFailuresInARow,
                                                     " times in a row; ", visit.why)));
  }
  observer_.say(visit.why);
  return absl::OkStatus();
}

absl::Status CaptureRun::Store(ConfigurationNumber number, const Visit& visit) {
  failures_in_a_row_ = 0;
  report_.max_deviation = std::max(report_.max_deviation, visit.deviation);
  RobotImage image;
  image.number = number;
  image.captured = visit.images.captured;
  image.commanded = parts_.robot.Commanded(parts_.travel->grid().At(number));
  image.measured = visit.measured;
  for (size_t v = 0; v < report_.views.size(); ++v) {
    image.masks.push_back(Difference(visit.images.images[v], parts_.references[v],
                                     parts_.segmentation, parts_.database->mask_sizes()[v]));
    report_.views[v].Add(image.masks.back());
  }
  return writer_.Put(image, /*replace=*/true);
}

absl::Status CaptureRun::StopRobot(const absl::Status& why) {
  const absl::Status stopped = parts_.robot.Stop();
  if (!stopped.ok()) {
    observer_.say(absl::StrCat("the robot could not be told to stop: ", stopped.message()));
  }
  return why;
}

}  // namespace silhouette
