// How old the messages of a stream are: ServerTime, kept up by round trips.
#pragma once

#include <chrono>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "clients/cpp/cancellation.h"
#include "clients/cpp/connection.h"
#include "clients/cpp/server_time.h"
#include "silhouette/v1/types.pb.h"

namespace silhouette::client {

// Of one stream, made after it was opened: a server that was started again has another clock. Not
// thread-safe.
class ServerClock {
 public:
  // `timeout`: for a round trip. `cancellation` ends one that is under way.
  ServerClock(std::shared_ptr<const Connection> connection, absl::Duration timeout,
              Cancellation& cancellation);

  // The earliest time at which the answer of this basis may have been made, if it was received at
  // `received`. Takes a round trip if the last one is a second old. Unimplemented if the server
  // tells no clock; Unavailable if no round trip was answered.
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
