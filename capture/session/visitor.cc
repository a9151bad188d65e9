#include "capture/session/visitor.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"

namespace silhouette {

absl::StatusOr<Visit> Visitor::Go(ConfigurationNumber number) {
  absl::StatusOr<std::vector<Configuration>> route;
  if (at_) {
    route = parts_.travel->Route(*at_, number);
  } else {
    absl::StatusOr<std::vector<double>> here = parts_.robot.Measure();
    if (!here.ok()) return here.status();
    here->resize(static_cast<size_t>(parts_.travel->grid().dimensions()));
    route = parts_.travel->RouteFrom(*here, number);
    if (!route.ok() && parts_.travel->regions().At(*here)) return route.status();
  }
  if (!route.ok()) {
    Visit visit;
    visit.outcome = Visit::Outcome::kUnreachable;
    visit.why = absl::StrCat("configuration ", number, ": ", route.status().message());
    return visit;
  }
  at_.reset();
  for (const Configuration& place : *route) {
    if (absl::Status status = parts_.robot.MoveTo(place); !status.ok()) return status;
  }
  return TakeImages(number);
}

absl::StatusOr<Visit> Visitor::TakeImages(ConfigurationNumber number) {
  const std::vector<double> commanded = parts_.robot.Commanded(parts_.travel->grid().At(number));
  const double tolerance = parts_.settings.joint_tolerance;
  Visit visit;
  for (int attempt = 0; attempt < 2; ++attempt) {  // some robots take longer to settle
    absl::SleepFor(parts_.settings.settle);
    absl::StatusOr<std::vector<double>> measured = parts_.robot.Measure();
    if (!measured.ok()) return measured.status();
    visit.measured = *std::move(measured);
    visit.deviation = parts_.robot.Deviation(commanded, visit.measured);
    if (visit.deviation <= tolerance) break;
  }
  if (visit.deviation > tolerance) return Missed(number, visit.deviation);
  absl::StatusOr<ImageSet> images = parts_.cameras.Grab(say_);
  if (!images.ok()) return images.status();
  visit.images = *std::move(images);
  const absl::StatusOr<std::vector<double>> after = parts_.robot.Measure();
  if (!after.ok()) return after.status();
  visit.deviation = std::max(visit.deviation, parts_.robot.Deviation(commanded, *after));
  if (visit.deviation > tolerance) return Missed(number, visit.deviation);
  visit.outcome = Visit::Outcome::kTaken;
  at_ = number;
  return visit;
}

Visit Visitor::Missed(ConfigurationNumber number, double deviation) const {
  Visit visit;
  visit.why = absl::StrFormat("configuration %d: a joint is off by %.4f, more than %.4f", number,
                              deviation, parts_.settings.joint_tolerance);
  visit.deviation = deviation;
  return visit;
}

}  // namespace silhouette
