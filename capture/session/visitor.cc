// SPDX-License-Identifier: Apache-2.0
#include "capture/session/visitor.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/segmentation/difference.h"
#include "capture/session/image_change.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr int kLeastAttempts = 2;
constexpr absl::Duration kLeastWait = absl::Milliseconds(1);

std::string NameOf(ConfigurationNumber number) { return absl::StrCat("configuration ", number); }

}  // namespace

absl::StatusOr<std::vector<double>> Visitor::Measure(absl::Duration since) {
  absl::StatusOr<std::vector<double>> measured = parts_.robot.Measure(since);
  robot_lost_ = absl::IsUnavailable(measured.status());
  return measured;
}

absl::Status Visitor::MoveTo(const Configuration& place) {
  absl::Status status = parts_.robot.MoveTo(place);
  robot_lost_ = absl::IsUnavailable(status);
  return status;
}

absl::StatusOr<Visit> Visitor::Go(ConfigurationNumber number) {
  robot_lost_ = false;
  absl::StatusOr<std::vector<Configuration>> route;
  if (at_) {
    route = parts_.travel->Route(*at_, number);
  } else {
    ASSIGN_OR_RETURN(std::vector<double> here, Measure());
    here.resize(static_cast<size_t>(parts_.travel->grid().dimensions()));
    route = parts_.travel->RouteFrom(here, number);
    if (!route.ok() && parts_.travel->regions().At(here)) return route.status();
  }
  if (!route.ok()) {
    Visit visit;
    visit.outcome = Visit::Outcome::kUnreachable;
    visit.why = absl::StrCat(NameOf(number), ": ", route.status().message());
    return visit;
  }
  at_.reset();
  for (const Configuration& place : *route) {
    if (observer_.stop_requested()) return absl::CancelledError("stopped");
    RETURN_IF_ERROR(MoveTo(place));
  }
  ASSIGN_OR_RETURN(Visit visit, TakeImages(parts_.travel->grid().At(number), NameOf(number)));
  if (visit.outcome == Visit::Outcome::kTaken) at_ = number;
  return visit;
}

absl::StatusOr<Visit> Visitor::GoStraight(const Configuration& place) {
  robot_lost_ = false;
  at_.reset();
  RETURN_IF_ERROR(MoveTo(place));
  return TakeImages(place, absl::StrCat("configuration (", absl::StrJoin(place, ", "), ")"));
}

void Visitor::StopRobot() {
  at_.reset();
  const absl::Status stopped = parts_.robot.Stop();
  if (!stopped.ok()) {
    observer_.say(absl::StrCat("the stop command to the robot failed: ", stopped.message()));
    robot_lost_ = true;
  }
}

absl::StatusOr<Visit> Visitor::TakeImages(const Configuration& place, const std::string& name) {
  const absl::Duration settle = parts_.settings.settle;
  absl::SleepFor(settle);
  const absl::Duration end = RunningNow() + parts_.settings.settle_timeout;
  alike_.clear();
  for (int attempt = 1;; ++attempt) {
    absl::StatusOr<Visit> visit = Look(place, name);
    if (!visit.ok() || visit->outcome == Visit::Outcome::kTaken) return visit;
    if (visit->why.empty()) continue;  // alike so far: the next, whatever the time
    // Some robots take longer to settle.
    if (attempt >= kLeastAttempts && RunningNow() >= end) return visit;
    absl::SleepFor(std::max(settle, kLeastWait));
  }
}

absl::StatusOr<Visit> Visitor::Look(const Configuration& place, const std::string& name) {
  const std::vector<double> commanded = parts_.robot.Commanded(place);
  const double tolerance = parts_.settings.joint_tolerance;
  Visit visit;
  ASSIGN_OR_RETURN(std::vector<double> measured, Measure());
  visit.measured = std::move(measured);
  visit.deviation = parts_.robot.Deviation(commanded, visit.measured);
  if (visit.deviation > tolerance) return Missed(name, commanded, visit.measured);
  absl::StatusOr<ImageSet> images = parts_.cameras.Grab(observer_.say);
  if (absl::IsDeadlineExceeded(images.status())) {
    return absl::UnavailableError(images.status().message());
  }
  if (!images.ok()) return images.status();
  visit.images = *std::move(images);
  ASSIGN_OR_RETURN(const std::vector<double> after, Measure(RunningNow()));
  const double moved = parts_.robot.Deviation(visit.measured, after);
  if (moved > tolerance) {
    return absl::AbortedError(
        absl::StrFormat("%s: the robot moved by %.4f while its images were taken", name, moved));
  }
  visit.deviation = std::max(visit.deviation, parts_.robot.Deviation(commanded, after));
  if (visit.deviation > tolerance) return Missed(name, commanded, after);
  if (const std::optional<std::string> view = ChangedView(visit.images)) {
    visit.why = absl::StrFormat(
        "%s: the images of the view '%s' still change though the robot stands still", name, *view);
    return visit;
  }
  if (std::ssize(alike_) < parts_.settings.still_images) return visit;
  alike_.pop_back();  // `images`
  visit.earlier = std::exchange(alike_, {});
  visit.outcome = Visit::Outcome::kTaken;
  return visit;
}

std::optional<std::string> Visitor::ChangedView(const ImageSet& images) {
  std::optional<std::string> changed;
  for (size_t v = 0; !alike_.empty() && v < images.images.size() && !changed; ++v) {
    const Reference* reference = parts_.references.empty() ? nullptr : &parts_.references[v];
    if (ImagesDiffer(alike_.back()[v], images.images[v], reference, parts_.segmentation)) {
      changed = parts_.database->cell().views(static_cast<int>(v)).name();
    }
  }
  if (changed) alike_.clear();
  alike_.push_back(images.images);
  return changed;
}

Visit Visitor::Missed(const std::string& name, const std::vector<double>& commanded,
                      const std::vector<double>& measured) {
  alike_.clear();
  Visit visit;
  visit.deviation = parts_.robot.Deviation(commanded, measured);
  visit.why = absl::StrFormat("%s: %s, off by %.4f, more than %.4f", name,
                              parts_.robot.WhichDeviates(commanded, measured), visit.deviation,
                              parts_.settings.joint_tolerance);
  return visit;
}

std::vector<Mask> RobotMasks(const SessionParts& parts, const Visit& visit) {
  const std::vector<MaskSize> sizes = parts.database->mask_sizes();
  std::vector<Mask> masks;
  for (size_t v = 0; v < visit.images.images.size(); ++v) {
    const auto mask_of = [&](const cv::Mat& image) {
      return RobotMask(image, parts.references[v], parts.segmentation, sizes[v]);
    };
    Mask mask = mask_of(visit.images.images[v]);
    for (const std::vector<cv::Mat>& set : visit.earlier) mask = mask | mask_of(set[v]);
    masks.push_back(std::move(mask));
  }
  return masks;
}

}  // namespace silhouette
