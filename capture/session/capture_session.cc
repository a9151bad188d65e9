// SPDX-License-Identifier: Apache-2.0
#include "capture/session/capture_session.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "capture/devices/running_clock.h"
#include "capture/session/capture_observer.h"
#include "capture/session/capture_plan.h"
#include "capture/session/capture_report.h"
#include "capture/session/first_look.h"
#include "capture/session/history.h"
#include "capture/session/raw_archive.h"
#include "capture/session/reference_images.h"
#include "capture/session/sentinels.h"
#include "capture/session/visitor.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr absl::Duration kBetween = absl::Seconds(3);
constexpr absl::Duration kMoment = absl::Milliseconds(50);

// Returns whether to go on waiting.
bool Wait(absl::Duration duration, const CaptureObserver& observer) {
  const absl::Duration end = RunningNow() + duration;
  while (RunningNow() < end) {
    if (observer.stop_requested()) return false;
    absl::SleepFor(std::min(kMoment, end - RunningNow()));
  }
  return !observer.stop_requested();
}

// Does `work` again and again while it ends with Unavailable, for `retry` from its first end on, a
// few seconds apart; after each, `lost` is called. Says so, and when it is over; counts in
// `report`. Returns what the last `work` did. A stop that was asked for ends the waiting.
absl::Status WithPatience(absl::Duration retry, const std::function<absl::Status()>& work,
                          const std::function<void()>& lost, const CaptureObserver& observer,
                          CaptureReport& report) {
  absl::Status status = work();
  if (!absl::IsUnavailable(status) || retry <= absl::ZeroDuration()) return status;
  const absl::Duration begin = RunningNow();
  ++report.losses;
  observer.say(absl::StrCat(status.message(), "; waiting up to ", SpokenTime(retry),
                            " for it to come back"));
  while (absl::IsUnavailable(status) && RunningNow() - begin < retry) {
    lost();
    if (!Wait(std::min(kBetween, retry / 10), observer)) break;
    status = work();
  }
  const absl::Duration waited = RunningNow() - begin;
  report.waited += waited;
  const std::string spoken = SpokenTime(absl::Trunc(waited, absl::Milliseconds(100)));
  if (absl::IsUnavailable(status)) {
    return absl::UnavailableError(
        absl::StrCat(status.message(), "; it did not come back within ", spoken));
  }
  if (status.ok()) observer.say(absl::StrCat("it is back, after ", spoken));
  return status;
}

// One run of a session, configuration by configuration.
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
  // With nothing to capture: visits the sentinels if an earlier session stored robot images since
  // they matched last.
  absl::Status CheckEarlierCaptures();
  // The sentinels that are not known yet, then what is planned, with visits to the sentinels
  // before, between and after.
  absl::Status CaptureAll();
  // False: a stop was requested.
  absl::StatusOr<bool> CaptureInTurn(const std::vector<ConfigurationNumber>& numbers);
  // Whether to go on: all is as it was, or somebody says so.
  absl::StatusOr<bool> CheckSentinels();
  // Keeps in the database which the sentinels are, once they are captured and the first look, for
  // which robot images wait, is over. Once.
  absl::Status RememberSentinels();
  // Waits for lost devices.
  absl::StatusOr<Visit> VisitPatiently(ConfigurationNumber number);
  // Once. A robot that was lost does not move before somebody says that it may.
  absl::StatusOr<Visit> VisitOnce(ConfigurationNumber number);
  // What was stored last is suspect if a camera repeated its image now: where one set is all that
  // is taken, it may have been frozen already, since before the robot arrived there.
  absl::Status SuspectFrozen();
  // Whether VisitPatiently ended because the operator stopped the robot, or did not want to wait
  // for a lost device.
  bool Stopped(const absl::Status& status) const;
  // Commits now unless the next configuration will be done before it is due.
  absl::Status CommitIfDue(absl::Duration now);
  absl::Status CheckDisk() const;
  // Not OK: the session ends. So do the others.
  absl::Status CaptureOne(ConfigurationNumber number);
  absl::Status CountMiss(const Visit& visit);
  absl::Status Store(ConfigurationNumber number, const Visit& visit);
  absl::Status Put(const RobotImage& image, const std::vector<std::string>& raw_images);
  // Stores what the first look has let wait, unless it finds it wrong. Once.
  absl::Status EndFirstLook();
  // Drops what waits, as the first look found `fault`. Stops the robot.
  absl::Status Refuse(const std::string& fault);
  // Says so if images were still waiting for the first look.
  void TellDropped() const;
  // Tells the robot to stop; returns `why`.
  absl::Status StopRobot(const absl::Status& why);

  SessionParts& parts_;
  RobotImageWriter& writer_;
  const CapturePlan& plan_;
  const CaptureObserver& observer_;
  Visitor visitor_;
  std::optional<Sentinels> sentinels_;
  // Nothing: it is over.
  std::optional<FirstLook> first_look_;
  struct Waiting {
    RobotImage image;
    std::vector<std::string> raw_images;
  };
  std::vector<Waiting> waiting_;
  CaptureReport report_;
  uint64_t done_ = 0;
  const absl::Time begun_ = absl::Now();
  bool put_ = false;           // a robot image was written
  bool first_sights_ = false;  // the sentinels are being captured
  bool remember_ = false;      // they are captured, and RememberSentinels() is due
  bool unchecked_ = false;     // something was captured since the sentinels were visited
  bool suspected_ = false;     // something was marked as suspect in this session
  int failures_in_a_row_ = 0;
  ConfigurationNumber last_number_ = 0;
  std::optional<absl::Time> last_stored_;  // when its images were captured
  absl::Duration last_commit_;
  absl::Duration last_cycle_;
};

CaptureRun::CaptureRun(SessionParts& parts, RobotImageWriter& writer, const CapturePlan& plan,
                       const CaptureObserver& observer)
    : parts_(parts),
      writer_(writer),
      plan_(plan),
      observer_(observer),
      visitor_(parts, observer),
      last_commit_(RunningNow()) {
  report_.planned = plan.captures.size();
  report_.kept = plan.kept;
  report_.new_sentinels_left = plan.new_sentinels;
  for (const storage::v1::View& view : parts.database->cell().views()) {
    report_.views.push_back({.name = view.name()});
  }
  if (plan.kept_images > 0) return;  // resumed
  std::vector<std::string> names;
  for (const ViewQuality& view : report_.views) names.push_back(view.name);
  first_look_.emplace(parts.settings.first_look, std::move(names));
}

CaptureReport CaptureRun::Go() {
  const absl::Duration begin = RunningNow();
  report_.status = Exclude();
  if (report_.status.ok()) report_.status = CaptureAll();
  TellDropped();
  const absl::Status committed = writer_.Commit();
  if (report_.status.ok()) report_.status = committed;
  // Exclusions are written first.
  report_.excluded = std::min<uint64_t>(writer_.committed(), plan_.exclusions.size());
  report_.captured = writer_.committed() - report_.excluded;
  absl::Status suspects = CountSuspects();
  if (report_.status.ok()) report_.status = suspects;
  report_.duration = RunningNow() - begin;
  return std::move(report_);
}

absl::Status CaptureRun::CountSuspects() {
  if (sentinels_ && sentinels_->going_on()) RETURN_IF_ERROR(sentinels_->EndGoingOn());
  std::vector<ConfigurationNumber> suspects;
  bool spans = false;
  {
    ASSIGN_OR_RETURN(const auto snapshot, parts_.database->Read());
    ASSIGN_OR_RETURN(suspects, SuspectNumbers(snapshot));
    ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
    spans = !history.suspects().empty();
  }
  // What was recaptured is not suspect, also where the clock has not passed the suspect span yet.
  const std::set<ConfigurationNumber> planned(plan_.captures.begin(), plan_.captures.end());
  const bool recaptured = report_.complete() && !suspected_ &&
                          std::ranges::all_of(suspects, [&](ConfigurationNumber number) {
                            return planned.contains(number);
                          });
  if (spans && recaptured) {
    RETURN_IF_ERROR(ChangeHistory(
        *parts_.database, [](storage::v1::CaptureHistory& history) { history.clear_suspects(); }));
    suspects.clear();
  }
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
  last_commit_ = RunningNow();
  return writer_.Commit();
}

absl::Status CaptureRun::CaptureAll() {
  ASSIGN_OR_RETURN(Sentinels sentinels, Sentinels::Open(parts_, plan_));
  sentinels_ = std::move(sentinels);
  if (plan_.captures.empty() && !plan_.check_sentinels) return CheckEarlierCaptures();
  if (plan_.check_sentinels && !sentinels_->Known()) {
    return absl::FailedPreconditionError(
        parts_.settings.sentinels.count == 0
            ? "there are no control configurations to check: state 'sentinels: {count: 3}' in "
              "'capture' of the cell file, and capture them with: silhouette-capture run "
              "--new-sentinels"
            : "there are no control configurations to check yet; capture them with: "
              "silhouette-capture run --new-sentinels");
  }
  const std::vector<ConfigurationNumber> first = sentinels_->ToCapture();
  absl::StatusOr<bool> go_on = true;
  if (sentinels_->Known()) go_on = CheckSentinels();
  if (!go_on.ok() || !*go_on) return go_on.status();
  first_sights_ = true;
  go_on = CaptureInTurn(first);
  first_sights_ = false;
  if (!go_on.ok() || !*go_on) return go_on.status();
  remember_ = !first.empty();
  RETURN_IF_ERROR(RememberSentinels());
  const std::set<ConfigurationNumber> there(first.begin(), first.end());
  std::vector<ConfigurationNumber> rest;
  for (const ConfigurationNumber number : plan_.captures) {
    if (!there.contains(number)) rest.push_back(number);
  }
  go_on = CaptureInTurn(rest);
  if (!go_on.ok() || !*go_on) return go_on.status();
  RETURN_IF_ERROR(EndFirstLook());
  return unchecked_ && sentinels_->Known() ? CheckSentinels().status() : absl::OkStatus();
}

absl::Status CaptureRun::RememberSentinels() {
  if (first_look_ || !std::exchange(remember_, false)) return absl::OkStatus();
  RETURN_IF_ERROR(sentinels_->Remember());
  report_.new_sentinels_left = false;
  return absl::OkStatus();
}

absl::Status CaptureRun::CheckEarlierCaptures() {
  if (!sentinels_->Known()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const bool unchecked, sentinels_->Unchecked());
  if (!unchecked) return absl::OkStatus();
  observer_.say(
      "robot images were captured since the control configurations matched last; the robot visits "
      "them now");
  return CheckSentinels().status();
}

absl::StatusOr<bool> CaptureRun::CaptureInTurn(const std::vector<ConfigurationNumber>& numbers) {
  for (const ConfigurationNumber number : numbers) {
    if (observer_.stop_requested()) {
      report_.stopped = true;
      return false;
    }
    const absl::Duration begin = RunningNow();
    if (!first_sights_ && sentinels_->Due(begin)) {
      const absl::StatusOr<bool> go_on = CheckSentinels();
      if (!go_on.ok() || !*go_on) return go_on;
    }
    RETURN_IF_ERROR(CommitIfDue(begin));
    RETURN_IF_ERROR(CaptureOne(number));
    if (report_.stopped) return false;
    last_cycle_ = RunningNow() - begin;
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
    if (Stopped(alarm.status())) {
      report_.stopped = true;
      static_cast<void>(StopRobot(absl::OkStatus()));
      return false;
    }
    if (!alarm.ok()) return StopRobot(alarm.status());
    ++report_.sentinel_checks;
    unchecked_ = false;
    report_.alarm = *alarm;
    report_.none_visited = sentinels_->none_visited();
    if (alarm->empty()) {
      const std::string line = absl::StrCat("sentinels visited: ", sentinels_->summary());
      plan_.check_sentinels ? observer_.say(line) : observer_.note(line);
      if (again) observer_.say("the cell is as it was");
      return true;
    }
    suspected_ = true;
    if (sentinels_->going_on()) {
      observer_.note(absl::StrCat("sentinels visited, still: ", *alarm));
      return true;
    }
    static_cast<void>(StopRobot(absl::OkStatus()));
    observer_.say(*alarm);
    switch (observer_.alarm(*alarm)) {
      case AfterAlarm::kEnd:
        return false;
      case AfterAlarm::kCheckAgain:
        break;
      case AfterAlarm::kGoOn:
        RETURN_IF_ERROR(sentinels_->GoOn());
        return true;
    }
  }
}

bool CaptureRun::Stopped(const absl::Status& status) const {
  return absl::IsCancelled(status) || (absl::IsUnavailable(status) && observer_.stop_requested());
}

absl::StatusOr<Visit> CaptureRun::VisitOnce(ConfigurationNumber number) {
  if (visitor_.robot_lost() && !parts_.settings.continue_after_reconnect) {
    const absl::Status back = parts_.robot.Measure().status();
    if (!back.ok()) return back;
    if (!observer_.robot_may_move()) {
      return absl::AbortedError(
          "the robot was lost, or a stop command did not reach it; it does not move on by itself: "
          "somebody may be with it (continue_after_reconnect)");
    }
  }
  absl::StatusOr<Visit> visit = visitor_.Go(number);
  RETURN_IF_ERROR(SuspectFrozen());
  return visit;
}

absl::Status CaptureRun::SuspectFrozen() {
  const std::optional<absl::Time> repeated = parts_.cameras.repeated();
  if (parts_.settings.still_images > 1 || !repeated || repeated != last_stored_) {
    return absl::OkStatus();
  }
  last_stored_.reset();
  suspected_ = true;
  observer_.say(absl::StrCat("configuration ", last_number_,
                             " is suspect: the camera may have been frozen already when it was "
                             "captured; recapture it with: run --only suspect"));
  return sentinels_->SuspectOne(*repeated, "captured when a camera may have been frozen already");
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
        // The next commit reports its error.
        static_cast<void>(writer_.Commit());
      },
      observer_, report_);
  if (!status.ok()) return status;
  return visit;
}

// The writer commits at the next Put(); not later than commit_interval after the last commit.
absl::Status CaptureRun::CommitIfDue(absl::Duration now) {
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
  report_.stopped = Stopped(visit.status());
  if (report_.stopped) return StopRobot(absl::OkStatus());
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
  image.masks = RobotMasks(parts_, visit);
  for (size_t v = 0; v < report_.views.size(); ++v) report_.views[v].Add(image.masks[v]);
  unchecked_ = true;
  last_number_ = number;
  last_stored_ = image.captured;
  sentinels_->Captured(image.captured);
  if (first_sights_) sentinels_->CapturedSentinel(number, visit, image.masks);
  const bool keep =
      parts_.settings.raw_images == RawImages::kAll ||
      (parts_.settings.raw_images == RawImages::kSentinels &&
       std::ranges::find(sentinels_->numbers(), number) != sentinels_->numbers().end());
  std::vector<std::string> raw_images;
  if (keep) raw_images = RawImagesOf(visit);
  if (!first_look_) return Put(image, raw_images);
  if (!first_look_->complete()) {
    std::string fault = first_look_->Add(number, image.masks);
    if (fault.empty() && parts_.expected) {
      fault = first_look_->Compare(number, image.masks, parts_.expected->Touched(image.measured));
    }
    if (!fault.empty()) return Refuse(fault);
  }
  waiting_.push_back({std::move(image), std::move(raw_images)});
  return first_look_->complete() ? EndFirstLook() : absl::OkStatus();
}

absl::Status CaptureRun::EndFirstLook() {
  if (!first_look_) return absl::OkStatus();
  const std::string fault = first_look_->Judge();
  if (!fault.empty()) return Refuse(fault);
  first_look_.reset();
  for (Waiting& waiting : std::exchange(waiting_, {})) {
    RETURN_IF_ERROR(Put(waiting.image, waiting.raw_images));
  }
  return RememberSentinels();
}

absl::Status CaptureRun::Refuse(const std::string& fault) {
  waiting_.clear();
  return StopRobot(absl::FailedPreconditionError(fault));
}

// One image shows neither whether the robot moves nor whether it stands in the reference images,
// and a session that finds images in the database does not look: they must not be stored unjudged.
void CaptureRun::TellDropped() const {
  if (waiting_.empty()) return;
  observer_.say(absl::StrCat("the session ended before its first look at ",
                             parts_.settings.first_look.configurations,
                             " configurations was over: the ", waiting_.size(),
                             " captured until then are not stored; the next session looks again"));
}

absl::Status CaptureRun::Put(const RobotImage& image, const std::vector<std::string>& raw_images) {
  const bool replaces_all = plan_.new_sentinels && plan_.kept_images == 0;
  if (!std::exchange(put_, true) && replaces_all) {
    RETURN_IF_ERROR(sentinels_->ReplaceAll(begun_));
  }
  return writer_.Put(image, /*replace=*/true, raw_images);
}

absl::Status CaptureRun::StopRobot(const absl::Status& why) {
  visitor_.StopRobot();
  return why;
}

}  // namespace

void ViewQuality::Add(const Mask& mask) {
  ++images;
  area += mask.Count();
  if (mask.Empty()) ++empty;
  if (TouchesBorder(mask)) ++touching_border;
}

double ViewQuality::mean_area() const {
  return images == 0 ? 0 : static_cast<double>(area) / static_cast<double>(images);
}

absl::StatusOr<CaptureSession> CaptureSession::Create(Database& database, const Travel& travel,
                                                      Robot& robot, CameraRig& rig,
                                                      const CaptureSettings& settings,
                                                      const SegmentationSettings& segmentation,
                                                      std::optional<DrawnRobot> expected) {
  ASSIGN_OR_RETURN(CellRobot cell_robot, CellRobot::Create(database.cell(), robot));
  ASSIGN_OR_RETURN(CellCameras cameras,
                   CellCameras::Create(database.cell(), rig, settings.noisy_views));
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
                         .segmentation = segmentation,
                         .expected = std::move(expected)});
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
