// SPDX-License-Identifier: Apache-2.0
#include "server/service/clients.h"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace silhouette {

const char* NameOf(Limit limit) {
  switch (limit) {
    case Limit::kConnections:
      return "connections";
    case Limit::kConnectionsPerClient:
      return "connections_per_client";
    case Limit::kStreams:
      return "streams";
    case Limit::kStreamsPerClient:
      return "streams_per_client";
    case Limit::kCallsPerSecond:
      return "calls_per_second";
    case Limit::kWaiting:
      break;
  }
  return "waiting";
}

std::string ClientAt(const std::string& host) {
  in6_addr address{};
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (inet_pton(AF_INET6, host.c_str(), &address) != 1 || IN6_IS_ADDR_LOOPBACK(&address) ||
      IN6_IS_ADDR_LINKLOCAL(&address)) {
    return host;
  }
  if (IN6_IS_ADDR_V4MAPPED(&address)) {
    return inet_ntop(AF_INET, address.s6_addr + 12, text.data(), text.size());
  }
  std::fill(address.s6_addr + 8, address.s6_addr + 16, 0);
  inet_ntop(AF_INET6, &address, text.data(), text.size());
  return absl::StrCat(text.data(), "/64");
}

std::string ClientOf(const std::string& peer) {
  if (absl::StartsWith(peer, "unix")) return "unix";
  const size_t scheme = peer.find(':');
  const size_t port = peer.rfind(':');
  if (scheme == std::string::npos || port <= scheme) return peer;
  std::string host = peer.substr(scheme + 1, port - scheme - 1);
  // An IPv6 address comes in brackets, which are escaped.
  if (absl::StartsWith(host, "%5B") && absl::EndsWith(host, "%5D")) {
    host = host.substr(3, host.size() - 6);
  }
  return ClientAt(host.substr(0, host.find('%')));  // without the link of an address that has one
}

Clients::Clients(const ClientLimits& limits) : limits_(limits) {}

std::shared_ptr<Clients::Record> Clients::RecordOf(const std::string& client) {
  auto& records = state_->records;
  if (const auto found = records.find(client); found != records.end()) return found->second;
  const auto in_use = [](const auto& named) {
    const ClientCounts& counts = named.second->counts;
    return counts.connections > 0 || counts.streams > 0;
  };
  if (records.size() >= kMost && client != kOthers) {
    const auto oldest =
        std::min_element(records.begin(), records.end(), [&](const auto& a, const auto& b) {
          return std::pair(in_use(a), a.second->last) < std::pair(in_use(b), b.second->last);
        });
    if (in_use(*oldest)) return RecordOf(kOthers);
    records.erase(oldest);
  }
  auto record = std::make_shared<Record>();
  record->counts.client = client;
  record->tokens = std::max(1.0, limits_.calls_per_second);
  record->last = std::chrono::steady_clock::now();
  return records.emplace(client, std::move(record)).first->second;
}

absl::Status Clients::Refuse(Record& record, Limit limit, double most) {
  ++record.counts.refused[static_cast<size_t>(limit)];
  return absl::ResourceExhaustedError(
      absl::StrCat("the limit '", NameOf(limit), "' (", most, ") is reached, client ",
                   record.counts.client, "; ask for less, or raise 'limits' in cell.yaml"));
}

absl::Status Clients::Call(const std::string& client) {
  const std::lock_guard lock(state_->mutex);
  Record& record = *RecordOf(client);
  const Time now = std::chrono::steady_clock::now();
  const std::chrono::duration<double> passed = now - record.last;
  record.last = now;
  const double rate = limits_.calls_per_second;
  record.tokens = std::min(std::max(1.0, rate), record.tokens + passed.count() * rate);
  if (record.tokens < 1) return Refuse(record, Limit::kCallsPerSecond, rate);
  record.tokens -= 1;
  ++record.counts.calls;
  return absl::OkStatus();
}

absl::StatusOr<Clients::Place> Clients::Take(const std::string& client, int State::*total,
                                             int ClientCounts::*own, Limit all, Limit of_client) {
  const bool connection = all == Limit::kConnections;
  const std::lock_guard lock(state_->mutex);
  const std::shared_ptr<Record> record = RecordOf(client);
  const int most = connection ? limits_.connections : limits_.streams;
  const int most_of_client =
      connection ? limits_.connections_per_client : limits_.streams_per_client;
  if ((*state_).*total >= most) return Refuse(*record, all, most);
  if (record->counts.*own >= most_of_client) return Refuse(*record, of_client, most_of_client);
  ++((*state_).*total);
  ++(record->counts.*own);
  return Place(nullptr, [state = state_, record, total, own](void*) {
    const std::lock_guard lock_at_end(state->mutex);
    --((*state).*total);
    --(record->counts.*own);
  });
}

absl::StatusOr<Clients::Place> Clients::Connection(const std::string& client) {
  return Take(client, &State::connections, &ClientCounts::connections, Limit::kConnections,
              Limit::kConnectionsPerClient);
}

absl::StatusOr<Clients::Place> Clients::Stream(const std::string& client) {
  return Take(client, &State::streams, &ClientCounts::streams, Limit::kStreams,
              Limit::kStreamsPerClient);
}

absl::Status Clients::TooBusy(const std::string& client) {
  const std::lock_guard lock(state_->mutex);
  ++RecordOf(client)->counts.refused[static_cast<size_t>(Limit::kWaiting)];
  return absl::ResourceExhaustedError(
      absl::StrCat("the server is busy: the limit 'waiting' or 'waiting_per_client' is reached, "
                   "client ",
                   client, "; try again"));
}

void Clients::LimitConnections(int most) {
  const std::lock_guard lock(state_->mutex);
  limits_.connections = std::min(limits_.connections, most);
}

std::vector<ClientCounts> Clients::Counts() const {
  const std::lock_guard lock(state_->mutex);
  std::vector<ClientCounts> counts;
  for (const auto& [client, record] : state_->records) counts.push_back(record->counts);
  return counts;
}

}  // namespace silhouette
