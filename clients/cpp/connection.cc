// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/connection.h"

#include <grpc/grpc.h>
#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <string_view>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "silhouette/client.h"

namespace silhouette::client {
namespace {

std::shared_ptr<grpc::Channel> ChannelTo(
    const std::string& address, const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
  // Once more than it is shut down: shutting down gRPC itself may wait ten seconds for a thread
  // that wrote much to a connection. The end of the process ends that.
  grpc_init();
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(-1);
  // gRPC's least backoff is also the time for one attempt to connect, handshake included: a busy
  // machine needs more than an instant.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 5000);
  // Reconnects to a restarted server within a second, as long as something waits for it
  // (Reconnect, Pause).
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  // During calls, a server that vanished silently is noticed within ten seconds. An answer may lie
  // unread for five: gRPC looks that often if no thread waits for it.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 3000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 7000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 0);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  return grpc::CreateCustomChannel(address, credentials, arguments);
}

// The process that had the first connection; 0: none had.
std::atomic<pid_t> connected_process = 0;

// Why no server answers at `address`, by gRPC's `message`.
std::string WhyUnavailable(const std::string& address, bool encrypted, const std::string& message) {
  if (absl::StrContains(message, "wrong version number")) {
    return absl::StrCat("the server at ", address,
                        " does not encrypt; connect without certificates, or start it with TLS");
  }
  if (absl::StrContains(message, "security handshaker")) {
    // While files are renewed, for a moment: Unavailable, as it passes.
    return absl::StrCat("the key for the connection to ", address,
                        " is not that of the certificate; name files that belong together");
  }
  if (encrypted) {
    return absl::StrCat("no server answers at ", address,
                        ", or the server or this client refuses the other's "
                        "certificate: wrong authority, wrong host, or expired (",
                        message, ")");
  }
  if (absl::StrContains(message, "DNS")) {
    return absl::StrCat("no host has the name in '", address,
                        "'; correct it, or use the host's IP address");
  }
  // So ends a connection without TLS to a server that has it, and one to a server that dies.
  if (absl::StrContains(message, "Socket closed") && !absl::StartsWith(address, "unix:")) {
    return absl::StrCat("no server answers at ", address,
                        " without certificates; start silhouette-server or use another address, "
                        "or give certificates if it has TLS");
  }
  return absl::StrCat("no server answers at ", address,
                      "; start silhouette-server or use another address");
}

}  // namespace

absl::Status RequireNotForked() {
  const pid_t process = connected_process.load();
  if (process == 0 || process == getpid()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "this process was forked from one that was connected to a server: start workers without "
      "fork, as multiprocessing's 'spawn' does, or connect in the workers alone");
}

absl::Status RequireCallable(absl::Duration timeout) {
  if (absl::Status usable = RequireNotForked(); !usable.ok()) return usable;
  if (timeout > absl::ZeroDuration()) return absl::OkStatus();
  return absl::InvalidArgumentError("the time for a call must be positive");
}

std::string SpokenTimeout(absl::Duration timeout) {
  const double seconds = absl::ToDoubleSeconds(timeout);
  return seconds < 1 ? absl::StrCat(seconds * 1e3, " ms") : absl::StrCat(seconds, " s");
}

absl::Status RequireAddress(const std::string& address) {
  constexpr std::string_view kUnix = "unix:";
  if (address.starts_with(kUnix)) {
    if (address.size() > kUnix.size()) return absl::OkStatus();
  } else {
    const size_t colon = address.rfind(':');
    int port = 0;
    // An IPv6 number has brackets: without, its last part would pass for the port.
    const bool ambiguous =
        address.find("::") != std::string::npos && address.find('[') == std::string::npos;
    if (colon != std::string::npos && colon > 0 && !ambiguous &&
        address.find("://") == std::string::npos &&
        absl::SimpleAtoi(address.substr(colon + 1), &port) && port > 0 && port < 65536) {
      return absl::OkStatus();
    }
  }
  return absl::InvalidArgumentError(absl::StrCat("'", address,
                                                 "' is not a server address; use host:port, as in ",
                                                 kDefaultAddress, ", or unix:path"));
}

absl::Status Malformed(const std::string& address, absl::string_view what) {
  return absl::InternalError(absl::StrCat("the answer of the server at ", address, " is unusable: ",
                                          what, "; use a silhouette-server of this version"));
}

Connection::Connection(const std::string& address,
                       const std::shared_ptr<grpc::ChannelCredentials>& credentials, bool encrypted)
    : address_(address),
      encrypted_(encrypted),
      channel_(ChannelTo(address, credentials)),
      collisions_(v1::CollisionService::NewStub(channel_)),
      scenes_(v1::SceneService::NewStub(channel_)),
      databases_(v1::DatabaseService::NewStub(channel_)) {
  pid_t none = 0;
  connected_process.compare_exchange_strong(none, getpid());
}

Connection::~Connection() {
  // To close it would write to the parent's sockets.
  if (!RequireNotForked().ok()) new std::shared_ptr<grpc::Channel>(channel_);
}

// gRPC reads its sockets while a thread waits for it, else every five seconds. A call on a failed
// connection fails at once: a client that only calls would leave each attempt unread until it is
// too old.
void Connection::Reconnect(absl::Time deadline) const {
  constexpr absl::Duration kMoment = absl::Milliseconds(50);
  if (channel_->GetState(false) != GRPC_CHANNEL_TRANSIENT_FAILURE) return;
  channel_->WaitForConnected(absl::ToChronoTime(std::min(deadline, absl::Now() + kMoment)));
}

void Connection::Pause(absl::Duration pause, const std::stop_token& stop) const {
  constexpr absl::Duration kInstant = absl::Milliseconds(50);
  // Also where the connection is there at once: what lies behind it may not be.
  const absl::Time least = absl::Now() + std::min(pause, absl::Milliseconds(200));
  const absl::Time end = absl::Now() + pause;
  const bool lost = channel_->GetState(false) != GRPC_CHANNEL_READY;
  for (absl::Time now = absl::Now(); now < end && !stop.stop_requested(); now = absl::Now()) {
    const absl::Time next = std::min(end, now + kInstant);
    const bool back = lost && channel_->WaitForConnected(absl::ToChronoTime(next));
    if (back && now >= least) return;
    absl::SleepFor(next - absl::Now());
  }
}

absl::Status Connection::RequireSameCell(const Cell& cell) const {
  const std::lock_guard lock(mutex_);
  if (!cell_) cell_ = cell;
  if (cell.digest == cell_->digest) return absl::OkStatus();
  const auto spoken = [](const Cell& of) {
    return of.digest == 0 ? std::string("a cell that it does not name")
                          : absl::StrCat("cell '", of.name, "'");
  };
  return absl::FailedPreconditionError(
      absl::StrCat("the server at ", address_, " now serves ", spoken(cell),
                   cell.name == cell_->name ? " with another grid, fixed joint or view"
                                            : absl::StrCat(", not ", spoken(*cell_)),
                   "; connect again"));
}

// Most of gRPC's status codes are absl's, with the same numbers.
absl::Status Connection::SentenceFor(const grpc::Status& status, absl::Duration timeout) const {
  const bool no_deadline = timeout == absl::InfiniteDuration();
  if (status.error_code() == grpc::StatusCode::CANCELLED ||
      (no_deadline && status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED)) {
    return absl::UnavailableError(absl::StrCat(
        "the server at ", address_, ", or a proxy on the way, ended the call; call again"));
  }
  switch (status.error_code()) {
    case grpc::StatusCode::OK:
      return absl::OkStatus();
    case grpc::StatusCode::UNAVAILABLE:
      return absl::UnavailableError(WhyUnavailable(address_, encrypted_, status.error_message()));
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return absl::DeadlineExceededError(
          absl::StrCat("the server at ", address_, " did not answer within ",
                       SpokenTimeout(timeout), "; request less at once or allow more time"));
    case grpc::StatusCode::UNIMPLEMENTED:
      return absl::UnimplementedError(
          absl::StrCat("the server at ", address_, " does not know this call (",
                       status.error_message(), "); use a silhouette-server of this version"));
    default:
      return absl::Status(static_cast<absl::StatusCode>(status.error_code()),
                          absl::StrCat("the server at ", address_, ": ", status.error_message()));
  }
}

}  // namespace silhouette::client
