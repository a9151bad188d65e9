// When something that the server made can have been made at the earliest, by this computer's clock.
//
// A message of a stream may have waited anywhere for any time. It tells what the server's running
// clock showed when it was made; what that means here follows from round trips: if a question was
// sent at `asked` and the answer says that the server's clock showed s, it showed s at `asked` or
// later. The two clocks may drift apart by kMostDrift of the time that passes; what was made d
// later by the server's clock was not made before asked + d - kMostDrift * |d|.
#pragma once

#include <chrono>
#include <optional>

#include "absl/time/time.h"

namespace silhouette::client {

// Clocks that cannot be: with what was seen before, something would have been made after it was
// received, as when a computer slept. All that was seen is forgotten then. Not thread-safe.
class ServerTime {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr double kMostDrift = 1e-3;

  // A round trip from `asked` to `answered`; the server's clock showed `server_clock` between them.
  void Observe(Time asked, Time answered, absl::Duration server_clock);

  // The earliest time at which the server's clock may have shown `server_clock`, for something that
  // was received at `received`; nothing if no round trip tells.
  std::optional<Time> Earliest(absl::Duration server_clock, Time received);

 private:
  struct RoundTrip {
    absl::Duration asked;  // since the epoch of the steady clock
    absl::Duration server_clock;
  };
  std::optional<RoundTrip> best_;  // gives the latest Earliest of what the server makes now
};

}  // namespace silhouette::client
