// SPDX-License-Identifier: Apache-2.0
// What each client of the server takes of it, and the limits of that.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/scene/client_limits.h"

namespace silhouette {

enum class Limit {
  kConnections,
  kConnectionsPerClient,
  kStreams,
  kStreamsPerClient,
  kCallsPerSecond,
  kWaiting,  // any of those of the queue
};
inline constexpr size_t kLimits = 6;
// As in cell.yaml.
const char* NameOf(Limit limit);

// Who asks, by the number of its host: all addresses of an IPv6 network of 64 bits are one client,
// as one host may take any of them; those that are valid on one link alone are as many clients.
std::string ClientAt(const std::string& host);

// Who asks, of what grpc::ServerContext::peer() says: ClientAt; "unix" for all that come over a
// socket of this machine.
std::string ClientOf(const std::string& peer);

// What one client has and had. `refused`: by Limit.
struct ClientCounts {
  std::string client;
  int connections = 0;
  int streams = 0;
  uint64_t calls = 0;
  std::array<uint64_t, kLimits> refused{};
};

// Thread-safe.
class Clients {
 public:
  // The most clients that are counted one by one. Those without a connection or stream that called
  // longest ago are forgotten for new ones; if there are none, new ones count as one client,
  // kOthers.
  static constexpr size_t kMost = 256;
  static constexpr char kOthers[] = "others";

  // Kept as long as what it stands for; it may outlive this.
  using Place = std::shared_ptr<void>;

  explicit Clients(const ClientLimits& limits);

  // A call, a connection, a stream. ResourceExhausted names the limit that is reached.
  absl::Status Call(const std::string& client);
  absl::StatusOr<Place> Connection(const std::string& client);
  absl::StatusOr<Place> Stream(const std::string& client);
  // The error of a call for which no place was left to wait.
  absl::Status TooBusy(const std::string& client);

  // At most as many connections, whatever the limits say.
  void LimitConnections(int most);

  std::vector<ClientCounts> Counts() const;

 private:
  using Time = std::chrono::steady_clock::time_point;
  struct Record {
    ClientCounts counts;
    double tokens = 0;  // calls that it may make now
    Time last;          // when tokens were counted
  };
  struct State {
    std::mutex mutex;
    std::map<std::string, std::shared_ptr<Record>> records;
    int connections = 0;
    int streams = 0;
  };

  // With the lock held.
  std::shared_ptr<Record> RecordOf(const std::string& client);
  absl::Status Refuse(Record& record, Limit limit, double most);
  // One more in `total` and in `own`, a member of the counts.
  absl::StatusOr<Place> Take(const std::string& client, int State::*total, int ClientCounts::*own,
                             Limit all, Limit of_client);

  ClientLimits limits_;
  const std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace silhouette
