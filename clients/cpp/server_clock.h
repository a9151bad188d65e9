// SPDX-License-Identifier: Apache-2.0
// How old the messages of a stream are.
#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "clients/cpp/connection.h"
#include "silhouette/v1/types.pb.h"

namespace silhouette::client {

// When something that the server made can have been made at the earliest, by this computer's clock.
//
// A message of a stream may have waited anywhere for any time. It carries what the server's running
// clock showed when it was made; what that means here follows from round trips: if a question was
// sent at `asked` and the answer says that the server's clock showed s, it showed s at `asked` or
// later. The two clocks may drift apart by kMostDrift of the time that passes; what was made d
// later by the server's clock was not made before asked + d - kMostDrift * |d|.
//
// Clocks that cannot be: with what was seen before, something would have been made after it was
// received, as when a computer slept. All that was seen is forgotten then. Not thread-safe.
class ServerTime {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr double kMostDrift = 1e-3;

  // A round trip from `asked` to `answered`; the server's clock showed `server_clock` between them.
  void Observe(Time asked, Time answered, absl::Duration server_clock);

  // The earliest time at which the server's clock may have shown `server_clock`, for something that
  // was received at `received`; nothing without a round trip.
  std::optional<Time> Earliest(absl::Duration server_clock, Time received);

 private:
  struct RoundTrip {
    absl::Duration asked;  // since the epoch of the steady clock
    absl::Duration server_clock;
  };
  std::optional<RoundTrip> best_;  // gives the latest Earliest of what the server makes now
};

// ServerTime, kept up by round trips. Of one stream, made after it was opened: a server that was
// started again has another clock. Not thread-safe.
class ServerClock {
 public:
  // `timeout`: for a round trip. `cancellation` ends one that is under way.
  ServerClock(std::shared_ptr<const Connection> connection, absl::Duration timeout,
              Cancellation& cancellation);

  // The earliest time at which the answer of this basis may have been made, if it was received at
  // `received`. Takes a round trip if the last one is a second old. Unimplemented if the server
  // reports no clock; Unavailable if no round trip was answered.
  absl::StatusOr<ServerTime::Time> MadeAt(const v1::Basis& basis, ServerTime::Time received);

 private:
  absl::Status Measure();

  const std::shared_ptr<const Connection> connection_;
  const absl::Duration timeout_;
  Cancellation& cancellation_;
  ServerTime time_;
  ServerTime::Time next_ = ServerTime::Time::min();  // when a round trip is due
};

}  // namespace silhouette::client
