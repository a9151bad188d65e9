// SPDX-License-Identifier: Apache-2.0
#include "capture/session/sentinels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/segmentation/difference.h"
#include "capture/session/history.h"
#include "capture/session/raw_archive.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Of very many checks the oldest are forgotten.
constexpr int kMostChecks = 2000;
constexpr double kNotToBeTold = std::numeric_limits<double>::quiet_NaN();
constexpr char kNonetheless[] = "captured although it did not match";
// Says, too, which known sentinels are not to be compared with.
constexpr char kToBeReplaced[] = "to be captured again by a run of all configurations";

// How far apart two configurations are, every joint's range taken as one.
double Apart(const ConfigurationGrid& grid, const Configuration& a, const Configuration& b) {
  double square = 0;
  for (size_t j = 0; j < a.size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    const double range = std::max(joint.upper - joint.lower, 1e-9);
    square += (a[j] - b[j]) * (a[j] - b[j]) / (range * range);
  }
  return std::sqrt(square);
}

storage::v1::SuspectSpan SpanOf(absl::Time after, absl::Time until, const std::string& why) {
  storage::v1::SuspectSpan span;
  SetTime(after, *span.mutable_after());
  SetTime(until, *span.mutable_until());
  span.set_why(why);
  return span;
}

// `span` holds all that was captured after its begin: it replaces the last ones that begin
// no earlier.
void AddSpan(const storage::v1::SuspectSpan& span, storage::v1::CaptureHistory& history) {
  auto& spans = *history.mutable_suspects();
  while (!spans.empty() && TimeOf(spans[spans.size() - 1].after()) >= TimeOf(span.after())) {
    spans.RemoveLast();
  }
  *spans.Add() = span;
}

// The latest time of robot images that are to be replaced.
absl::Time ToBeReplacedUntil(const storage::v1::CaptureHistory& history) {
  absl::Time until = absl::InfinitePast();
  for (const storage::v1::SuspectSpan& span : history.suspects()) {
    if (span.why() == kToBeReplaced) until = std::max(until, TimeOf(span.until()));
  }
  return until;
}

absl::StatusOr<absl::Time> LatestCaptureIn(const Database& database) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  return LatestCapture(snapshot);
}

// Ends spans that reach into the future now, or with the latest robot image if that is later.
absl::Status EndOpenSpans(Database& database) {
  const absl::Time now = absl::Now();
  {
    ASSIGN_OR_RETURN(const auto snapshot, database.Read());
    ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
    const bool open = std::ranges::any_of(
        history.suspects(), [&](const auto& span) { return TimeOf(span.until()) > now; });
    if (!open) return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const absl::Time latest, LatestCaptureIn(database));
  const absl::Time end = std::max(now, latest);
  return ChangeHistory(database, [&](storage::v1::CaptureHistory& history) {
    for (storage::v1::SuspectSpan& span : *history.mutable_suspects()) {
      if (TimeOf(span.until()) > end) SetTime(end, *span.mutable_until());
    }
  });
}

}  // namespace

std::vector<ConfigurationNumber> WellSpread(const ConfigurationGrid& grid,
                                            const std::vector<ConfigurationNumber>& among,
                                            int count, std::vector<ConfigurationNumber> chosen) {
  const auto most = static_cast<size_t>(std::max(count, 0));
  if (chosen.size() > most) chosen.resize(most);
  if (chosen.size() == most || among.empty()) return chosen;
  std::vector<double> nearest(among.size(), INFINITY);
  const auto part_from = [&](ConfigurationNumber number) {
    const Configuration at = grid.At(number);
    for (size_t i = 0; i < among.size(); ++i) {
      nearest[i] = std::min(nearest[i], Apart(grid, at, grid.At(among[i])));
    }
  };
  for (const ConfigurationNumber number : chosen) part_from(number);
  while (chosen.size() < most) {
    const auto furthest = std::max_element(nearest.begin(), nearest.end());
    if (*furthest == 0) break;  // all are chosen
    chosen.push_back(among[static_cast<size_t>(furthest - nearest.begin())]);
    part_from(chosen.back());
  }
  return chosen;
}

absl::StatusOr<Sentinels> Sentinels::Open(SessionParts& parts, const CapturePlan& plan) {
  Sentinels sentinels(parts);
  RETURN_IF_ERROR(EndOpenSpans(*parts.database));
  const int count = parts.settings.sentinels.count;
  if (count == 0) return sentinels;
  ASSIGN_OR_RETURN(const auto snapshot, parts.database->Read());
  ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
  for (const ConfigurationNumber number : history.sentinels()) {
    if (parts.travel->grid().Contains(number) && !parts.travel->Forbidden(number)) {
      sentinels.numbers_.push_back(number);
    }
  }
  if (plan.new_sentinels && !plan.captures.empty()) sentinels.numbers_.clear();
  sentinels.numbers_ =
      WellSpread(parts.travel->grid(), plan.captures, count, std::move(sentinels.numbers_));
  const std::set<ConfigurationNumber> planned(plan.captures.begin(), plan.captures.end());
  const bool all_planned = std::ranges::all_of(
      sentinels.numbers_, [&](ConfigurationNumber number) { return planned.contains(number); });
  RETURN_IF_ERROR(
      sentinels.ReadFirsts(snapshot, history, planned, all_planned && !plan.new_sentinels));
  for (const ConfigurationNumber number : sentinels.numbers_) {
    if (!sentinels.firsts_.contains(number) && planned.contains(number)) {
      sentinels.to_capture_.push_back(number);
    }
  }
  sentinels.first_baseline_ = sentinels.firsts_.empty();
  const absl::Time good_check = LastGoodCheck(history);
  if (!plan.new_sentinels && good_check != absl::InfinitePast()) sentinels.last_good_ = good_check;
  // The clock ran ahead then, or is behind now.
  if (sentinels.last_good_ > absl::Now()) sentinels.last_good_ = absl::InfinitePast();
  return sentinels;
}

absl::Status Sentinels::ReadFirsts(const Snapshot& snapshot,
                                   const storage::v1::CaptureHistory& history,
                                   const std::set<ConfigurationNumber>& planned,
                                   bool compare_planned) {
  const absl::Time to_be_replaced = ToBeReplacedUntil(history);
  for (const ConfigurationNumber number : numbers_) {
    if (planned.contains(number) && !compare_planned) continue;
    const auto image = snapshot.Find(number);
    if (!image.ok() || !image->has_value() || (*image)->excluded) continue;
    if ((*image)->captured <= to_be_replaced) continue;
    First first;
    first.measured = (*image)->measured;
    first.captured = (*image)->captured;
    for (size_t v = 0; v < (*image)->masks.size(); ++v) {
      const auto raw = snapshot.FindRawImage(number, static_cast<int>(v));
      cv::Mat grey;
      if (raw.ok() && raw->has_value()) grey = ImageInPng((*raw)->png);
      if (!grey.empty()) grey = Grey(grey);
      if (grey.size() != parts_->references[v].size()) grey.release();
      first.views.push_back(WithShadows(v, {grey, (*image)->masks[v]}));
    }
    last_good_ = std::max(last_good_, first.captured);
    firsts_[number] = std::move(first);
  }
  return absl::OkStatus();
}

void Sentinels::Captured(absl::Time captured) {
  earliest_since_ = std::min(earliest_since_, captured);
  if (captured >= last_good_ || set_back_) return;
  set_back_ = true;
  last_check_ = -absl::InfiniteDuration();
}

void Sentinels::CapturedSentinel(ConfigurationNumber number, const Visit& visit,
                                 const std::vector<Mask>& masks) {
  First first{.views = {}, .measured = visit.measured, .captured = visit.images.captured};
  for (size_t v = 0; v < masks.size(); ++v) {
    first.views.push_back(WithShadows(v, {Grey(visit.images.images[v]).clone(), masks[v]}));
  }
  firsts_[number] = std::move(first);
  last_check_ = RunningNow();
  if (first_baseline_) NoteGood(visit.images.captured);
}

void Sentinels::NoteGood(absl::Time begin) {
  last_good_ = begin;
  earliest_since_ = absl::InfiniteFuture();
  set_back_ = false;
}

bool Sentinels::Due(absl::Duration now) const {
  return Known() && now - last_check_ >= parts_->settings.sentinels.every;
}

std::vector<SentinelImage> Sentinels::Look(const Visit& visit) const {
  std::vector<Mask> masks = RobotMasks(*parts_, visit);
  std::vector<SentinelImage> views;
  for (size_t v = 0; v < masks.size(); ++v) {
    views.push_back(WithShadows(v, {Grey(visit.images.images[v]), std::move(masks[v])}));
  }
  return views;
}

SentinelImage Sentinels::WithShadows(size_t view, SentinelImage image) const {
  if (parts_->segmentation.shadows == Shadows::kForeground || image.grey.empty()) return image;
  SegmentationSettings settings = parts_->segmentation;
  settings.shadows = Shadows::kForeground;
  image.mask = Difference(image.grey, parts_->references[view], settings, image.mask.size());
  return image;
}

void Sentinels::Note(ConfigurationNumber number, First& first, const Visit& visit,
                     storage::v1::SentinelCheck& check, std::vector<Complaints>& complaints) {
  std::vector<SentinelImage> now = Look(visit);
  for (size_t v = 0; v < now.size(); ++v) {
    SentinelImage& at_first = first.views[v];
    // Where no image was kept, this is the first; its mask is comparable only with shadows in it.
    const bool is_first = at_first.grey.empty();
    if (is_first && parts_->segmentation.shadows == Shadows::kIgnore) at_first.mask = now[v].mask;
    const Sight sight = Compare(at_first, now[v], parts_->references[v]);
    storage::v1::SentinelSight& noted = *check.add_sights();
    noted.set_number(number);
    noted.set_view(static_cast<int>(v));
    noted.set_shift_x(sight.background ? sight.background->x : kNotToBeTold);
    noted.set_shift_y(sight.background ? sight.background->y : kNotToBeTold);
    noted.set_robot_x(sight.robot ? sight.robot->x : kNotToBeTold);
    noted.set_robot_y(sight.robot ? sight.robot->y : kNotToBeTold);
    noted.set_gain(sight.gain);
    noted.set_mask_pixels(sight.mask_pixels);
    noted.set_core_pixels(sight.core_pixels);
    noted.set_joint_deviation(
        first.measured.empty() ? 0 : parts_->robot.Deviation(first.measured, visit.measured));
    const std::string complaint = Complaint(sight, parts_->settings.sentinels.most_shift);
    if (!complaint.empty() && complaints[v].count++ == 0) complaints[v].first = complaint;
    if (is_first) at_first.grey = now[v].grey.clone();
  }
}

std::string Sentinels::Alarm(const std::vector<Complaints>& complaints, int visited) const {
  std::vector<std::string> parts;
  for (size_t v = 0; v < complaints.size(); ++v) {
    if (complaints[v].count == 0) continue;
    std::string part =
        absl::StrCat("view '", parts_->database->cell().views(static_cast<int>(v)).name(), "' ",
                     complaints[v].first);
    if (complaints[v].count < visited) {
      absl::StrAppend(&part, " (seen at ", complaints[v].count, " of ", visited, " sentinels)");
    }
    parts.push_back(std::move(part));
  }
  return absl::StrJoin(parts, "; ");
}

std::string Sentinels::Summarise(const storage::v1::SentinelCheck& check) const {
  double shift = 0;
  int pixels = 0;
  double gain = 1;
  for (const storage::v1::SentinelSight& sight : check.sights()) {
    const double length = std::hypot(sight.shift_x(), sight.shift_y());
    if (std::isfinite(length)) shift = std::max(shift, length);
    pixels = std::max(pixels, sight.mask_pixels());
    if (std::abs(std::log(sight.gain())) > std::abs(std::log(gain))) gain = sight.gain();
  }
  return absl::StrFormat(
      "largest shift %.2f camera pixels, most mask pixels that differ %d, brightness %.3f times",
      shift, pixels, gain);
}

absl::StatusOr<std::string> Sentinels::Check(const Go& go) {
  none_visited_ = false;
  storage::v1::SentinelCheck check;
  std::vector<Complaints> complaints(parts_->references.size());
  int visited = 0;
  bool reachable = false;
  std::string why_not;
  absl::Time begin = absl::InfiniteFuture();
  for (const ConfigurationNumber number : numbers_) {
    const auto first = firsts_.find(number);
    if (first == firsts_.end()) continue;
    ASSIGN_OR_RETURN(const Visit visit, go(number));
    reachable = reachable || visit.outcome != Visit::Outcome::kUnreachable;
    if (visit.outcome != Visit::Outcome::kTaken) {
      why_not = visit.why;
      continue;
    }
    ++visited;
    begin = std::min(begin, visit.images.captured);
    Note(number, first->second, visit, check, complaints);
  }
  last_check_ = RunningNow();
  if (!reachable && !to_capture_.empty()) {
    summary_ = "the known control configurations are in another part of the grid";
    return std::string();
  }
  none_visited_ = visited == 0;
  SetTime(none_visited_ ? absl::Now() : begin, *check.mutable_time());
  const std::string alarm =
      none_visited_ ? absl::StrCat(
                          "no control configuration could be visited, so nothing shows whether the "
                          "cell changed (",
                          why_not,
                          "); correct that, or state a greater 'sentinels: {count}' in the cell "
                          "file, which adds others")
                    : Alarm(complaints, visited);
  check.set_alarm(alarm);
  summary_ = Summarise(check);
  if (alarm.empty() && !going_on_) NoteGood(begin);
  RETURN_IF_ERROR(Keep(std::move(check)));
  return alarm;
}

absl::Status Sentinels::Keep(storage::v1::SentinelCheck check) {
  std::optional<storage::v1::SuspectSpan> suspect;
  if (!check.alarm().empty() || going_on_) {
    ASSIGN_OR_RETURN(suspect, SpanSinceGood(going_on_ ? kNonetheless : check.alarm()));
  }
  return ChangeHistory(*parts_->database, [&](storage::v1::CaptureHistory& history) {
    history.mutable_checks()->Add(std::move(check));
    const int surplus = history.checks_size() - kMostChecks;
    if (surplus > 0) history.mutable_checks()->DeleteSubrange(0, surplus);
    if (suspect) AddSpan(*suspect, history);
  });
}

absl::Status Sentinels::Remember() {
  return ChangeHistory(*parts_->database, [&](storage::v1::CaptureHistory& history) {
    history.mutable_sentinels()->Assign(numbers_.begin(), numbers_.end());
  });
}

absl::Status Sentinels::ReplaceAll(absl::Time begun) {
  ASSIGN_OR_RETURN(const absl::Time latest, LatestCaptureIn(*parts_->database));
  if (latest == absl::InfinitePast()) return absl::OkStatus();
  return ChangeHistory(*parts_->database, [&](storage::v1::CaptureHistory& history) {
    AddSpan(SpanOf(absl::InfinitePast(), std::max(begun, latest), kToBeReplaced), history);
    if (numbers_.empty()) return;
    history.mutable_sentinels()->Assign(numbers_.begin(), numbers_.end());
  });
}

absl::StatusOr<bool> Sentinels::Unchecked() const {
  ASSIGN_OR_RETURN(const auto snapshot, parts_->database->Read());
  ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
  ASSIGN_OR_RETURN(const absl::Time latest, LatestCapture(snapshot));
  const absl::Time good = LastGoodCheck(history);
  return good < latest || good > absl::Now();  // the clock ran ahead then, or is behind now
}

absl::StatusOr<storage::v1::SuspectSpan> Sentinels::SpanSinceGood(const std::string& why) const {
  ASSIGN_OR_RETURN(const absl::Time latest, LatestCaptureIn(*parts_->database));
  const absl::Time until = std::max(absl::Now(), latest);
  absl::Time after = std::min(last_good_, earliest_since_ - absl::Nanoseconds(1));
  if (after >= until) after = absl::InfinitePast();
  return SpanOf(after, going_on_ ? absl::InfiniteFuture() : until, why);
}

absl::Status Sentinels::Suspect(const std::string& why) {
  ASSIGN_OR_RETURN(const auto span, SpanSinceGood(why));
  return ChangeHistory(*parts_->database,
                       [&](storage::v1::CaptureHistory& history) { AddSpan(span, history); });
}

absl::Status Sentinels::SuspectOne(absl::Time captured, const std::string& why) {
  return ChangeHistory(*parts_->database, [&](storage::v1::CaptureHistory& history) {
    *history.add_suspects() = SpanOf(captured - absl::Nanoseconds(1), captured, why);
  });
}

absl::Status Sentinels::GoOn() {
  going_on_ = true;
  return Suspect(kNonetheless);
}

absl::Status Sentinels::EndGoingOn() {
  going_on_ = false;
  return Suspect(kNonetheless);
}

}  // namespace silhouette
