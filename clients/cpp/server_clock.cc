// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/server_clock.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "silhouette/messages.h"

namespace silhouette::client {
namespace {

// While the clock is not known, and once it is.
constexpr absl::Duration kLongestFirstRoundTrip = absl::Seconds(3);
constexpr absl::Duration kLongestRoundTrip = absl::Seconds(1);
constexpr RunningClock::duration kBetweenRoundTrips = std::chrono::seconds(1);

absl::Duration SinceEpoch(ServerTime::Time time) {
  return absl::FromChrono(time.time_since_epoch());
}

}  // namespace

RunningClock::time_point After(RunningClock::time_point time, absl::Duration duration) {
  constexpr absl::Duration kLongest = absl::Hours(24 * 36500);
  return time + absl::ToChronoNanoseconds(std::clamp(duration, -kLongest, kLongest));
}

void ServerTime::Observe(Time asked, Time answered, absl::Duration server_clock) {
  const std::optional<Time> earliest = Earliest(server_clock, answered);
  if (!earliest || *earliest < asked) {
    asked_ = {.local = SinceEpoch(asked), .server_clock = server_clock};
  }
  const std::optional<absl::Duration> at_least = ClockAt(answered);
  const bool better = !at_least || *at_least <= server_clock;
  if (better || *ClockAt(asked) > server_clock) {
    answered_ = {.local = SinceEpoch(answered), .server_clock = server_clock};
  }
}

std::optional<absl::Duration> ServerTime::ClockAt(Time at) const {
  if (!answered_) return std::nullopt;
  const absl::Duration later = SinceEpoch(at) - answered_->local;
  return answered_->server_clock + later - kMostDrift * absl::AbsDuration(later);
}

std::optional<ServerTime::Time> ServerTime::Earliest(absl::Duration server_clock, Time received) {
  if (!asked_) return std::nullopt;
  const absl::Duration later = server_clock - asked_->server_clock;
  const absl::Duration earliest = asked_->local + later - kMostDrift * absl::AbsDuration(later);
  const absl::Duration waited = SinceEpoch(received) - earliest;
  if (waited < absl::ZeroDuration()) {
    asked_.reset();
    return std::nullopt;
  }
  // Rounded up, as all of it.
  return After(received, -waited) - std::chrono::nanoseconds(1);
}

ServerClock::ServerClock(std::shared_ptr<const Connection> connection, absl::Duration timeout,
                         Cancellation& cancellation)
    : connection_(std::move(connection)), timeout_(timeout), cancellation_(cancellation) {}

absl::Status ServerClock::Measure() {
  grpc::ClientContext context;
  const Cancellation::Call call(cancellation_, context);
  const RunningClock::time_point asked = RunningClock::now();
  const absl::Duration timeout =
      std::min(timeout_, time_.ClockAt(asked) ? kLongestRoundTrip : kLongestFirstRoundTrip);
  const auto response = connection_->Call(context, &v1::CollisionService::Stub::CheckConfigurations,
                                          v1::CheckConfigurationsRequest(), timeout);
  const RunningClock::time_point answered = RunningClock::now();
  // A slow server is asked less often.
  next_ = answered + std::max(kBetweenRoundTrips, 4 * (answered - asked));
  if (!response.ok()) return response.status();
  if (absl::Status same = connection_->RequireSameCell(response->basis()); !same.ok()) return same;
  if (!response->basis().has_server_clock()) {
    return absl::UnimplementedError(absl::StrCat("the server at ", connection_->address(),
                                                 " does not report its clock, so the age of its "
                                                 "messages is unknown; use a silhouette-server of "
                                                 "this version"));
  }
  time_.Observe(asked, answered, FromMessage(response->basis().server_clock()));
  return absl::OkStatus();
}

absl::Status ServerClock::MeasureIfDue() {
  return RunningClock::now() >= next_ ? Measure() : absl::OkStatus();
}

absl::StatusOr<absl::Duration> ServerClock::ClockAt(ServerTime::Time at) {
  if (absl::Status measured = MeasureIfDue(); !measured.ok()) return measured;
  const std::optional<absl::Duration> clock = time_.ClockAt(at);
  if (clock) return *clock;
  return absl::UnavailableError(
      absl::StrCat("the clock of the server at ", connection_->address(), " is not known"));
}

void ServerClock::Forget() {
  time_ = {};
  next_ = ServerTime::Time::min();
}

absl::StatusOr<ServerTime::Time> ServerClock::MadeAt(const v1::Basis& basis,
                                                     ServerTime::Time received) {
  absl::Status measured = MeasureIfDue();
  if (absl::IsUnimplemented(measured) || absl::IsFailedPrecondition(measured)) return measured;
  if (!basis.has_server_clock()) {
    return absl::UnimplementedError(absl::StrCat("the server at ", connection_->address(),
                                                 " does not report the time of its messages; use a "
                                                 "silhouette-server of this version"));
  }
  const absl::Duration made = FromMessage(basis.server_clock());
  std::optional<ServerTime::Time> earliest = time_.Earliest(made, received);
  if (!earliest) {
    if (measured.ok()) measured = Measure();
    if (absl::IsDeadlineExceeded(measured)) return absl::UnavailableError(measured.message());
    if (!measured.ok()) return measured;
    earliest = time_.Earliest(made, received);
  }
  if (!earliest) {
    return absl::UnavailableError(absl::StrCat(
        "the clock of the server at ", connection_->address(), " contradicts earlier answers"));
  }
  return *earliest;
}

}  // namespace silhouette::client
