#include "capture/session/capture_run.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "capture/segmentation/difference.h"
#include "capture/session/capture_session.h"
#include "capture/session/history.h"
#include "capture/session/patience.h"
#include "capture/session/raw_archive.h"
#include "db/status/status_macros.h"

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
  absl::Status suspects = CountSuspects();
  if (report_.status.ok()) report_.status = suspects;
  report_.duration = absl::Now() - begin;
  return std::move(report_);
}

absl::Status CaptureRun::CountSuspects() {
  if (going_on_) {
    RETURN_IF_ERROR(sentinels_->Suspect(absl::Now(), "captured although it did not match"));
  }
  ASSIGN_OR_RETURN(const auto snapshot, parts_.database->Read());
  ASSIGN_OR_RETURN(const auto suspects, SuspectNumbers(snapshot));
  report_.suspect = suspects.size();
  return absl::OkStatus();
}

absl::Status CaptureRun::Exclude() {
  for (const ConfigurationNumber number : plan_.exclusions) {
    RobotImage image;
    image.number = number;
    image.excluded = true;
    image.captured = absl::Now();
    RETURN_IF_ERROR(writer_.Put(image, /*replace=*/true));
  }
  last_commit_ = absl::Now();
  return writer_.Commit();
}

absl::Status CaptureRun::CaptureAll() {
  ASSIGN_OR_RETURN(Sentinels sentinels, Sentinels::Open(parts_, plan_));
  sentinels_ = std::move(sentinels);
  if (plan_.captures.empty() && !plan_.check_sentinels) return absl::OkStatus();
  const std::vector<ConfigurationNumber> first = sentinels_->ToCapture();
  absl::StatusOr<bool> go_on = true;
  if (sentinels_->Known()) go_on = CheckSentinels();
  if (!go_on.ok() || !*go_on) return go_on.status();
  first_sights_ = true;
  go_on = CaptureInTurn(first);
  first_sights_ = false;
  if (!go_on.ok() || !*go_on) return go_on.status();
  if (!first.empty()) {
    RETURN_IF_ERROR(sentinels_->Remember());
  }
  const std::set<ConfigurationNumber> there(first.begin(), first.end());
  std::vector<ConfigurationNumber> rest;
  for (const ConfigurationNumber number : plan_.captures) {
    if (!there.contains(number)) rest.push_back(number);
  }
  go_on = CaptureInTurn(rest);
  if (!go_on.ok() || !*go_on) return go_on.status();
  return unchecked_ && sentinels_->Known() ? CheckSentinels().status() : absl::OkStatus();
}

absl::StatusOr<bool> CaptureRun::CaptureInTurn(const std::vector<ConfigurationNumber>& numbers) {
  for (const ConfigurationNumber number : numbers) {
    if (observer_.stop_requested()) {
      report_.stopped = true;
      return false;
    }
    const absl::Time begin = absl::Now();
    if (!first_sights_ && sentinels_->Due(begin)) {
      const absl::StatusOr<bool> go_on = CheckSentinels();
      if (!go_on.ok() || !*go_on) return go_on;
    }
    RETURN_IF_ERROR(CommitIfDue(begin));
    RETURN_IF_ERROR(CaptureOne(number));
    last_cycle_ = absl::Now() - begin;
    observer_.progress(++done_);
  }
  return true;
}

absl::StatusOr<bool> CaptureRun::CheckSentinels() {
  for (bool again = false;; again = true) {
    // Nothing is at risk while the robot goes there, or somebody thinks.
    RETURN_IF_ERROR(writer_.Commit());
    const absl::StatusOr<std::string> alarm =
        sentinels_->Check([this](ConfigurationNumber number) { return VisitPatiently(number); });
    if (StoppedWaiting(alarm.status())) {
      report_.stopped = true;
      return false;
    }
    if (!alarm.ok()) return StopRobot(alarm.status());
    ++report_.sentinel_checks;
    unchecked_ = false;
    report_.alarm = *alarm;
    if (alarm->empty()) {
      const std::string line = absl::StrCat("sentinels visited: ", sentinels_->summary());
      plan_.check_sentinels ? observer_.say(line) : observer_.note(line);
      if (again) observer_.say("the cell is as it was");
      return true;
    }
    if (going_on_) {
      observer_.note(absl::StrCat("sentinels visited, still: ", *alarm));
      return true;
    }
    static_cast<void>(StopRobot(absl::OkStatus()));
    observer_.say(*alarm);
    if (!again) {
      RETURN_IF_ERROR(sentinels_->Suspect(absl::Now(), *alarm));
    }
    switch (observer_.alarm(*alarm)) {
      case AfterAlarm::kEnd:
        return false;
      case AfterAlarm::kCheckAgain:
        break;
      case AfterAlarm::kGoOn:
        going_on_ = true;
        return true;
    }
  }
}

bool CaptureRun::StoppedWaiting(const absl::Status& status) const {
  return absl::IsUnavailable(status) && observer_.stop_requested();
}

absl::StatusOr<Visit> CaptureRun::VisitOnce(ConfigurationNumber number) {
  if (robot_lost_) {
    const absl::Status back = parts_.robot.Measure().status();
    if (!back.ok()) return back;
    if (!observer_.robot_may_move()) {
      return absl::AbortedError(
          "the robot was lost and is back, and does not move on by itself: somebody may be with it "
          "(continue_after_reconnect)");
    }
    robot_lost_ = false;
  }
  absl::StatusOr<Visit> visit = visitor_.Go(number);
  robot_lost_ = visitor_.robot_lost() && !parts_.settings.continue_after_reconnect;
  return visit;
}

absl::StatusOr<Visit> CaptureRun::VisitPatiently(ConfigurationNumber number) {
  absl::StatusOr<Visit> visit;
  absl::Status status = WithPatience(
      parts_.settings.retry,
      [&] {
        visit = VisitOnce(number);
        return visit.status();
      },
      [&] {
        static_cast<void>(StopRobot(absl::OkStatus()));
        // What comes of it is told by the next commit.
        static_cast<void>(writer_.Commit());
      },
      observer_, report_);
  if (!status.ok()) return status;
  return visit;
}

// The writer commits at the next Put(); not later than commit_interval after the last commit.
absl::Status CaptureRun::CommitIfDue(absl::Time now) {
  if (now + last_cycle_ - last_commit_ < parts_.settings.commit_interval) return absl::OkStatus();
  last_commit_ = now;
  RETURN_IF_ERROR(writer_.Commit());
  return CheckDisk();
}

absl::Status CaptureRun::CheckDisk() const {
  std::error_code error;
  const auto space = std::filesystem::space(parts_.database->path(), error);
  if (error || space.available >= parts_.settings.keep_free) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrFormat(
      "the disk of '%s' has only %.1f MB left, less than the %.1f MB that are to stay free "
      "(keep_free); make room",
      parts_.database->path(), static_cast<double>(space.available) / 1e6,
      static_cast<double>(parts_.settings.keep_free) / 1e6));
}

absl::Status CaptureRun::CaptureOne(ConfigurationNumber number) {
  const absl::StatusOr<Visit> visit = VisitPatiently(number);
  if (StoppedWaiting(visit.status())) return absl::OkStatus();
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
  unchecked_ = true;
  if (first_sights_) sentinels_->Captured(number, visit, image.masks);
  const bool keep =
      parts_.settings.raw_images == RawImages::kAll ||
      (parts_.settings.raw_images == RawImages::kSentinels &&
       std::ranges::find(sentinels_->numbers(), number) != sentinels_->numbers().end());
  return writer_.Put(image, /*replace=*/true,
                     keep ? RawImagesOf(visit.images) : std::vector<std::string>());
}

absl::Status CaptureRun::StopRobot(const absl::Status& why) {
  const absl::Status stopped = parts_.robot.Stop();
  if (!stopped.ok()) {
    observer_.say(absl::StrCat("the robot could not be told to stop: ", stopped.message()));
  }
  return why;
}

}  // namespace silhouette
