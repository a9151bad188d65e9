// SPDX-License-Identifier: Apache-2.0
// The server's running clock: the age of a stream's messages, and the stamps of published images.
#pragma once

#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "clients/cpp/connection.h"
#include "silhouette/running_clock.h"
#include "silhouette/v1/types.pb.h"

namespace silhouette::client {

// The time that is `duration` later. Durations beyond 100 years count as that: longer ones
// overflow.
RunningClock::time_point After(RunningClock::time_point time, absl::Duration duration);

// What round trips tell about the server's running clock.
//
// Earliest: the earliest time, by this computer's clock, at which the server can have made a
// message. A message of a stream may have been delayed for any time. It states the server's running
// clock when it was made. Round trips relate this clock to the local one: if a question was sent at
// `asked` and the answer states the server's clock s, the clock showed s at `asked` or later. The
// two clocks may drift apart by kMostDrift of the passing time. So a message made d later by the
// server's clock was not made before asked + d - kMostDrift * |d|.
//
// If earlier round trips imply that a message was made after its arrival, for example because the
// server of another computer has the address now, they are all dropped.
//
// ClockAt: what the server's clock showed at a local time, at least. If an answer that states s
// arrived at `answered`, the clock showed s at `answered` or earlier; so d later it showed
// s + d - kMostDrift * |d| at least. A round trip that states less than that (the server's computer
// was restarted) takes the place of all earlier ones. Neither clock stands still while its computer
// sleeps.
//
// Not thread-safe.
class ServerTime {
 public:
  using Time = RunningClock::time_point;
  static constexpr double kMostDrift = 1e-3;

  // A round trip from `asked` to `answered`; the server's clock showed `server_clock` between them.
  void Observe(Time asked, Time answered, absl::Duration server_clock);

  // The earliest time at which the server's clock may have shown `server_clock`, for a message that
  // arrived at `received`; nothing without a round trip.
  std::optional<Time> Earliest(absl::Duration server_clock, Time received);

  // What the server's clock showed at the local time `at`, or less; nothing without a round trip.
  std::optional<absl::Duration> ClockAt(Time at) const;

 private:
  // An end of a round trip, and the server's clock during it.
  struct RoundTripEnd {
    absl::Duration local;  // since the epoch of RunningClock
    absl::Duration server_clock;
  };
  std::optional<RoundTripEnd> asked_;     // gives the latest Earliest of what the server makes now
  std::optional<RoundTripEnd> answered_;  // gives the greatest ClockAt of now
};

// A ServerTime with its round trips. Created after a stream was opened, and for it alone: a
// restarted server has another clock. For stamps: as long as the server does not refuse one
// (Forget). Not thread-safe.
class ServerClock {
 public:
  // `timeout`: of a round trip, of which none is waited for longer than 3 s, once the clock is
  // known 1 s. `cancellation` ends a running one.
  ServerClock(std::shared_ptr<const Connection> connection, absl::Duration timeout,
              Cancellation& cancellation);

  // The earliest time at which the message with this basis may have been made, if it arrived at
  // `received`. Makes a round trip if the last one is a second old. Unimplemented if the server
  // reports no clock; Unavailable if no round trip was answered.
  absl::StatusOr<ServerTime::Time> MadeAt(const v1::Basis& basis, ServerTime::Time received);

  // What the server's clock showed at the local time `at`, or less; errors as MadeAt.
  absl::StatusOr<absl::Duration> ClockAt(ServerTime::Time at);

  // Drops all round trips: the server's clock is another now.
  void Forget();

 private:
  absl::Status Measure();
  // A round trip, if one is due.
  absl::Status MeasureIfDue();

  const std::shared_ptr<const Connection> connection_;
  const absl::Duration timeout_;
  Cancellation& cancellation_;
  ServerTime time_;
  ServerTime::Time next_ = ServerTime::Time::min();  // when a round trip is due
};

}  // namespace silhouette::client
