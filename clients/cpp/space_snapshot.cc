#include "clients/cpp/space_snapshot.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace silhouette::client {

using Clock = std::chrono::steady_clock;

Validity ValidityOf(const Basis& basis, absl::Duration valid_for, absl::Duration max_age) {
  const absl::Duration of_age = max_age - std::max(basis.scene_age, absl::ZeroDuration());
  // Longer cannot be reckoned with.
  constexpr absl::Duration kVeryLong = absl::Hours(24 * 36500);
  const absl::Duration valid = std::clamp(std::min(valid_for, of_age), -kVeryLong, kVeryLong);
  return {.until = basis.asked + absl::ToChronoNanoseconds(valid),
          .then = valid_for < of_age ? Reason::kUpdateExpired : Reason::kUpdateTooOld};
}

SpaceSnapshot::SpaceSnapshot(std::unique_ptr<const Content> content)
    : content_(std::move(content)) {}
SpaceSnapshot::~SpaceSnapshot() = default;

const Basis& SpaceSnapshot::basis() const { return content_->basis; }
uint64_t SpaceSnapshot::number() const { return content_->number; }
uint64_t SpaceSnapshot::skipped_scenes() const { return content_->skipped_scenes; }
uint64_t SpaceSnapshot::tiles_changed() const { return content_->tiles_changed; }

std::optional<Reason> SpaceSnapshot::unknown() const {
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

// The clock is looked at last: the answer is right at a moment before it is given.
State SpaceSnapshot::StateAt(ConfigurationNumber number) const {
  const Content& content = *content_;
  if (content.unknown || content.map == nullptr) return State::kUnknown;
  const State state = content.map->StateAt(number);
  return Clock::now() < content.validity.until ? state : State::kUnknown;
}

void SpaceSnapshot::StatesAt(std::span<const ConfigurationNumber> numbers,
                             std::span<State> states) const {
  if (numbers.size() != states.size()) {
    throw std::invalid_argument("as many states as numbers are asked for");
  }
  std::ranges::fill(states, State::kUnknown);
  if (unknown()) return;
  std::ranges::transform(numbers, states.begin(), [this](ConfigurationNumber number) {
    return content_->map->StateAt(number);
  });
  if (unknown()) std::ranges::fill(states, State::kUnknown);
}

Verdict SpaceSnapshot::Check(std::span<const double> configuration) const {
  Verdict verdict;
  if (const SpaceMap* map = content_->map.get()) {
    verdict = CheckInMap(map->grid, content_->rule.value_or(OffGridRule()), configuration,
                         [map](ConfigurationNumber number) { return map->StateAt(number); });
    // Without the rule, the corners around it say nothing.
    if (!content_->rule && map->grid.CornersAround(configuration).count() > 1) {
      verdict = {.reason = Reason::kBetweenGridPoints};
    }
    verdict.regions = content_->basis.regions;
  }
  if (const std::optional<Reason> reason = unknown()) return {.reason = *reason};
  return verdict;
}

StateCounts SpaceSnapshot::Count() const {
  StateCounts counts;
  if (content_->map == nullptr) return counts;
  if (!unknown()) {
    for (const auto& tile : content_->map->tiles) {
      if (tile != nullptr) client::Count(*tile, counts);
    }
  }
  counts.unknown = content_->map->grid.size() - counts.free - counts.occupied;
  return counts;
}

}  // namespace silhouette::client
