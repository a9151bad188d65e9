// SPDX-License-Identifier: Apache-2.0
#include "server/service/separation.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "server/service/calls.h"
#include "server/service/messages.h"

namespace silhouette {
namespace {

constexpr int kMostLevels = 16;
// About a second of a worker thread.
constexpr int64_t kMostPlaces = 500'000;
// A scene may be followed by the next so much later than any of the last ones.
constexpr double kLateScene = 1.25;
// A path leads away though the robot comes nearer by so much on it, metres: distances are told in
// steps of voxels.
constexpr double kSameDistance = 0.02;

absl::StatusOr<SeparationSettings> SettingsFrom(const v1::SeparationPolicy& message,
                                                const SeparationSettings& defaults) {
  SeparationSettings settings = defaults;
  if (message.has_human_speed()) settings.human_speed = message.human_speed();
  if (message.has_near_human_speed()) settings.near_human_speed = message.near_human_speed();
  if (message.has_reaction_time()) settings.reaction_time = message.reaction_time();
  if (message.has_intrusion()) settings.intrusion = message.intrusion();
  if (message.has_uncertainty()) settings.uncertainty = message.uncertainty();
  if (message.levels_size() > kMostLevels) {
    return absl::InvalidArgumentError(absl::StrCat(
        "separation.levels: there are ", message.levels_size(), "; state at most ", kMostLevels));
  }
  if (message.levels_size() > 0) settings.levels.clear();
  for (const v1::SpeedLevel& level : message.levels()) {
    settings.levels.push_back(
        {level.name(), level.speed(), level.stopping_time(), level.stopping_distance()});
  }
  try {
    RequireValid(settings);
  } catch (const std::invalid_argument& error) {
    return FieldError("separation", error.what());
  }
  if (message.has_horizon() && !(message.horizon() >= 0)) {
    return absl::InvalidArgumentError("separation.horizon: it must not be negative");
  }
  return settings;
}

// How old the scene may become before the next reply can be there.
absl::Duration ImageAge(const Serving& serving, const Served& served, const Moment& now) {
  const absl::Duration next = kLateScene * serving.scenes.LongestGap();
  return std::min(served.scene->AgeAt(now) + next, serving.settings.scene.max_age);
}

}  // namespace

absl::Status AnswerSeparation(const Serving& serving, const Checker& checker,
                              std::span<const Configuration> waypoints,
                              const v1::SeparationPolicy& request, const Stop& cancelled,
                              v1::Separation* separation) {
  const Served& served = checker.served();
  const SeparationBasis* basis = served.database->separation();
  if (basis == nullptr) {
    return absl::FailedPreconditionError(
        "separation: distances to people need camera models in the database, and the robot's model "
        "and the sections 'sound' and 'separation' in the cell file");
  }
  ASSIGN_OR_RETURN(const SeparationSettings settings, SettingsFrom(request, basis->settings()));
  const std::optional<double> horizon =
      request.has_horizon() ? std::optional(request.horizon()) : std::nullopt;
  int64_t places = 0;
  const auto stop = [&] { return ++places > kMostPlaces || Stopped(cancelled); };
  const std::optional<PathDistance> path = checker.Distance(waypoints, horizon, stop);
  if (places > kMostPlaces) {
    return absl::ResourceExhaustedError(
        absl::StrCat("separation: distances are looked at in more than ", kMostPlaces,
                     " places of the path; state a horizon, or split it"));
  }
  if (!path && Stopped(cancelled)) return absl::CancelledError();
  const Moment now = serving.settings.clock();
  const Reason blocked =
      BlockedReason(served, {.preset = Preset::kSound}, serving.settings.scene, now);
  separation->set_range(basis->range());
  if (!path || blocked != Reason::kNone) {
    const Reason reason = blocked != Reason::kNone ? blocked : Reason::kOutsideGrid;
    separation->set_unknown_reason(ToMessage(reason));
    return absl::OkStatus();
  }
  const absl::Duration age = ImageAge(serving, served, now);
  std::vector<double> distances;
  for (const SpeedLevel& level : settings.levels) {
    distances.push_back(ProtectiveDistance(settings, level, absl::ToDoubleSeconds(age)));
  }
  const size_t kept = LevelsKept(distances, path->distance);
  separation->set_level(static_cast<int>(kept));
  if (kept > 0) separation->set_level_name(settings.levels[kept - 1].name);
  separation->set_distance(path->distance);
  separation->mutable_nearest()->set_segment(path->segment);
  separation->mutable_nearest()->set_fraction(path->fraction);
  separation->set_leads_away(path->distance >= path->at_start - kSameDistance);
  separation->mutable_protective_distances()->Assign(distances.begin(), distances.end());
  separation->set_image_age(absl::ToDoubleSeconds(age));
  ToMessage(age - served.scene->AgeAt(now), separation->mutable_valid_for());
  return absl::OkStatus();
}

}  // namespace silhouette
