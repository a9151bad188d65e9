// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/space_snapshot.h"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "clients/cpp/motion_in_map.h"
#include "clients/cpp/server_clock.h"

namespace silhouette::client {

using Clock = RunningClock;

namespace {

// The server's bounds of CheckPathRequest.path_resolution, metres.
constexpr double kLeastResolution = 0.0005;
constexpr double kMostResolution = 0.1;

}  // namespace

Validity ValidityOf(const Basis& basis, absl::Duration max_age) {
  const Clock::time_point too_old =
      After(basis.asked, max_age - std::max(basis.scene_age, absl::ZeroDuration()));
  if (basis.valid_until < too_old) return {basis.valid_until, Reason::kUpdateExpired};
  return {too_old, Reason::kUpdateTooOld};
}

SpaceSnapshot::SpaceSnapshot(std::unique_ptr<const Content> content)
    : content_(std::move(content)) {}
SpaceSnapshot::~SpaceSnapshot() = default;

const Basis& SpaceSnapshot::basis() const { return content_->basis; }
uint64_t SpaceSnapshot::number() const { return content_->number; }
uint64_t SpaceSnapshot::skipped_scenes() const { return content_->skipped_scenes; }
uint64_t SpaceSnapshot::tiles_changed() const { return content_->tiles_changed; }

std::optional<Reason> SpaceSnapshot::unknown_reason() const {
  if (content_->unknown || content_->map == nullptr) {
    return content_->unknown.value_or(Reason::kNoUpdate);
  }
  if (Clock::now() >= content_->validity.until) return content_->validity.then;
  return std::nullopt;
}

Clock::time_point SpaceSnapshot::usable_until() const {
  return content_->unknown ? Clock::time_point::min() : content_->validity.until;
}

const ConfigurationGrid* SpaceSnapshot::grid() const {
  return content_->map == nullptr ? nullptr : &content_->map->grid;
}

// Looks at the clock last: the answer was right at a moment before it is returned.
State SpaceSnapshot::StateAt(ConfigurationNumber number) const {
  const Content& content = *content_;
  if (content.unknown || content.map == nullptr) return State::kUnknown;
  const State state = content.map->StateAt(number);
  return Clock::now() < content.validity.until ? state : State::kUnknown;
}

Verdict SpaceSnapshot::InMap(std::span<const double> q) const {
  const SpaceMap* map = content_->map.get();
  if (map == nullptr) return {};
  if (content_->drawn != nullptr) {
    Verdict verdict = content_->drawn->Check(q, *map);
    verdict.regions = content_->basis.regions;
    return verdict;
  }
  Verdict verdict = CheckInMap(
      map->grid, content_->rule.value_or(OffGridRule()), q,
      [map](ConfigurationNumber number) { return map->StateAt(number); },
      [map](ConfigurationNumber number) { return map->CellAt(number); });
  // Without the rule, the corners around it decide nothing.
  if (!content_->rule && map->grid.CornersAround(q).count() > 1) {
    verdict = {.reason = Reason::kBetweenGridPoints};
  }
  verdict.regions = content_->basis.regions;
  return verdict;
}

Verdict SpaceSnapshot::Check(std::span<const double> q) const {
  Verdict verdict = InMap(q);
  if (const std::optional<Reason> reason = unknown_reason()) return {.reason = *reason};
  return verdict;
}

MotionVerdict SpaceSnapshot::CheckMotion(std::span<const double> from, std::span<const double> to,
                                         double path_resolution) const {
  if (!(path_resolution >= kLeastResolution && path_resolution <= kMostResolution)) {
    throw std::invalid_argument("path_resolution must be 0.0005 to 0.1 m");
  }
  MotionVerdict motion;
  if (content_->drawn != nullptr) {
    motion = content_->drawn->CheckMotion(from, to, path_resolution);
  } else if (content_->map != nullptr) {
    motion = content_->rule ? CheckMotionInMap(*content_->map, *content_->rule, from, to)
                            : UnknownMotion(Reason::kBetweenGridPoints, from);
  }
  if (const std::optional<Reason> reason = unknown_reason()) return UnknownMotion(*reason, from);
  return motion;
}

ConfigurationChecks SpaceSnapshot::CheckConfigurations(
    std::span<const Configuration> configurations) const {
  ConfigurationChecks checks{.basis = content_->basis, .verdicts = {}};
  for (const Configuration& q : configurations) checks.verdicts.push_back(InMap(q));
  if (const std::optional<Reason> reason = unknown_reason()) {
    checks.verdicts.assign(configurations.size(), {.reason = *reason});
  }
  return checks;
}

NumberChecks SpaceSnapshot::CheckNumbers(std::span<const uint32_t> numbers) const {
  const std::vector<uint64_t> none((numbers.size() + 63) / 64, 0);
  NumberChecks checks{.basis = content_->basis,
                      .unknown_reason = Reason::kNotInMap,
                      .size = numbers.size(),
                      .free = none,
                      .occupied = none};
  if (content_->map != nullptr) {
    for (size_t i = 0; i < numbers.size(); ++i) {
      const State state = content_->map->StateAt(numbers[i]);
      checks.free[i / 64] |= uint64_t{state == State::kFree} << (i % 64);
      checks.occupied[i / 64] |= uint64_t{state == State::kOccupied} << (i % 64);
    }
  }
  if (const std::optional<Reason> reason = unknown_reason()) {
    checks.unknown_reason = *reason;
    std::ranges::fill(checks.free, 0);
    std::ranges::fill(checks.occupied, 0);
  }
  return checks;
}

StateCounts SpaceSnapshot::Count() const {
  StateCounts counts;
  if (content_->map == nullptr) return counts;
  if (!unknown_reason()) {
    for (const auto& tile : content_->map->tiles) {
      if (tile != nullptr) client::Count(*tile, counts);
    }
  }
  counts.unknown = content_->map->grid.size() - counts.free - counts.occupied;
  return counts;
}

}  // namespace silhouette::client
