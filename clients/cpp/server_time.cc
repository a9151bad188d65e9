#include "clients/cpp/server_time.h"

#include <algorithm>

namespace silhouette::client {
namespace {

// What is older is told to be so old: durations beyond cannot be reckoned with.
constexpr absl::Duration kServerTimeVeryLong = absl::Hours(24 * 36500);

absl::Duration SinceEpoch(ServerTime::Time time) {
  return absl::FromChrono(time.time_since_epoch());
}

}  // namespace

void ServerTime::Observe(Time asked, Time answered, absl::Duration server_clock) {
  const std::optional<Time> earliest = Earliest(server_clock, answered);
  if (earliest && *earliest >= asked) return;
  best_ = {.asked = SinceEpoch(asked), .server_clock = server_clock};
}

std::optional<ServerTime::Time> ServerTime::Earliest(absl::Duration server_clock, Time received) {
  if (!best_) return std::nullopt;
  const absl::Duration later = server_clock - best_->server_clock;
  const absl::Duration earliest = best_->asked + later - kMostDrift * absl::AbsDuration(later);
  const absl::Duration waited = SinceEpoch(received) - earliest;
  if (waited < absl::ZeroDuration()) {
    best_.reset();
    return std::nullopt;
  }
  // Rounded up, as all of it.
  return received - (absl::ToChronoNanoseconds(std::min(waited, kServerTimeVeryLong)) +
                     std::chrono::nanoseconds(1));
}

}  // namespace silhouette::client
