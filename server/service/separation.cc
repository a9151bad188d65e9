// SPDX-License-Identifier: Apache-2.0
#include "server/service/separation.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "db/mask/interpolation.h"
#include "db/status/status_macros.h"
#include "server/service/calls.h"
#include "server/service/messages.h"

namespace silhouette {
namespace {

constexpr int kMostLevels = 16;
// About a second of a worker thread.
constexpr int64_t kMostPlaces = 50'000;
// A scene may be followed by the next so much later than any of the last ones.
constexpr double kLateScene = 1.25;
// A path leads away though the robot comes nearer by so much on it, metres: distances change in
// steps of voxels.
constexpr double kSameDistance = 0.02;
// As a horizon.
constexpr double kAllOfIt = std::numeric_limits<double>::infinity();

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

struct LevelsNow {
  KeptLevels kept;
  std::vector<double> distances;  // that the levels keep, metres
  absl::Duration image_age;       // that they count on
};

// The levels that keep their distance from the path: all of it, or as far as the horizon and until
// the robot stands. Nothing: as Checker::Distance.
std::optional<LevelsNow> LevelsKeptOn(const Serving& serving, const Checker& checker,
                                      std::span<const Configuration> waypoints,
                                      const SeparationSettings& settings, double horizon,
                                      const Stop& stop) {
  // The first distance of a scene takes longest: the age is that after it.
  if (!checker.Distance(waypoints.first(1), std::nullopt, stop)) return std::nullopt;
  LevelsNow now;
  now.image_age = ImageAge(serving, checker.served(), serving.settings.clock());
  const double age = absl::ToDoubleSeconds(now.image_age);
  const bool has_direction = waypoints.size() > 1;
  for (const SpeedLevel& level : settings.levels) {
    now.distances.push_back(ProtectiveDistance(settings, level, age) +
                            (has_direction ? 0 : WayToStop(settings, level, age)));
  }
  std::optional<PathDistance> whole;  // the same for all levels
  if (horizon == kAllOfIt) {
    whole = checker.Distance(waypoints, std::nullopt, stop);
    if (!whole) return std::nullopt;
  }
  const auto kept = LevelsKept(now.distances, [&](size_t level) {
    if (whole) return whole;
    const double ahead = horizon + WayToStop(settings, settings.levels[level], age);
    return checker.Distance(waypoints, ahead, stop);
  });
  if (!kept) return std::nullopt;
  now.kept = *kept;
  return now;
}

void ToMessage(const LevelsNow& now, const SeparationSettings& settings, double leave_from,
               v1::Separation& message) {
  const KeptLevels& kept = now.kept;
  message.set_level(static_cast<int>(kept.count));
  if (kept.count > 0) message.set_level_name(settings.levels[kept.count - 1].name);
  message.set_distance(kept.path.distance);
  message.mutable_nearest()->set_segment(kept.path.segment);
  message.mutable_nearest()->set_fraction(kept.path.fraction);
  message.set_leads_away(kept.path.whole && kept.path.at_start > leave_from &&
                         kept.path.distance >= kept.path.at_start - kSameDistance);
  message.mutable_protective_distances()->Assign(now.distances.begin(), now.distances.end());
  message.set_image_age(absl::ToDoubleSeconds(now.image_age));
}

Configuration PlaceOn(std::span<const Configuration> waypoints, const PathDistance& at) {
  const auto segment = static_cast<size_t>(at.segment);
  if (segment + 1 == waypoints.size()) return waypoints[segment];
  return Interpolated(waypoints[segment], waypoints[segment + 1], at.fraction);
}

}  // namespace

absl::StatusOr<absl::Duration> AnswerSeparation(const Serving& serving, const Checker& checker,
                                                std::span<const Configuration> waypoints,
                                                const v1::SeparationPolicy& request,
                                                const Stop& cancelled, v1::Separation* separation) {
  const Served& served = checker.served();
  const SeparationBasis* basis = served.database->separation().get();
  if (basis == nullptr) {
    return absl::FailedPreconditionError(
        "separation: distances to people need camera models in the database, and the robot's model "
        "and the sections 'sound' and 'separation' in the cell file");
  }
  ASSIGN_OR_RETURN(const SeparationSettings settings, SettingsFrom(request, basis->settings()));
  const double horizon = request.has_horizon() ? request.horizon() : kAllOfIt;
  // Where nothing moves, all parts count, in every direction.
  const bool moves = std::ranges::any_of(
      waypoints, [&](const Configuration& q) { return q != waypoints.front(); });
  if (!moves) waypoints = waypoints.first(1);
  int64_t places = 0;
  const auto stop = [&] { return ++places > kMostPlaces || Stopped(cancelled); };
  const auto kept = LevelsKeptOn(serving, checker, waypoints, settings, horizon, stop);
  if (places > kMostPlaces) {
    return absl::ResourceExhaustedError(
        absl::StrCat("separation: distances are looked at in more than ", kMostPlaces,
                     " places of the path; state a horizon, or split it"));
  }
  if (!kept && Stopped(cancelled)) return absl::CancelledError();
  const Moment now = serving.settings.clock();
  Served of_now = served;  // what has become known of the calibration meanwhile counts, too
  of_now.trust = serving.scenes.trust();
  const Policy sound{.preset = Preset::kSound};
  const Reason blocked = BlockedReason(of_now, sound, serving.settings.scene, now);
  separation->set_range(basis->range());
  if (!kept || blocked != Reason::kNone) {
    Reason reason = blocked != Reason::kNone ? blocked : checker.blocked();
    if (reason == Reason::kNone) reason = Reason::kOutsideGrid;
    separation->set_unknown_reason(ToMessage(reason));
    return now.running;
  }
  ToMessage(*kept, settings, basis->leave_from(), *separation);
  for (const double position : PlaceOn(waypoints, kept->kept.path)) {
    separation->mutable_nearest()->mutable_configuration()->add_positions(position);
  }
  ToMessage(std::min(kept->image_age - served.scene->AgeAt(now),
                     ValidFor(of_now, sound, serving.settings.scene, now)),
            separation->mutable_valid_for());
  return now.running;
}

}  // namespace silhouette
