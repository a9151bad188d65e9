// SPDX-License-Identifier: Apache-2.0
// A network between a host and its clients that delays what the host sends.
#pragma once

#include <sys/socket.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <list>
#include <thread>
#include <utility>
#include <vector>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/robots/tcp_socket.h"

namespace silhouette {

class SlowNetwork {
 public:
  // To the host at 127.0.0.1:port.
  explicit SlowNetwork(int port)
      : host_port_(port),
        listening_(ListenTcp("127.0.0.1", 0).value()),
        thread_([this] { Run(); }) {}
  ~SlowNetwork() {
    stopping_ = true;
    thread_.join();
  }

  int port() const { return PortOf(listening_); }
  // Of all that comes from the host from now on.
  void Delay(absl::Duration delay) { delay_ns_ = absl::ToInt64Nanoseconds(delay); }

 private:
  struct Connection {
    FileDescriptor client, host;
    std::deque<std::pair<absl::Duration, std::vector<uint8_t>>> under_way;
  };

  void Run() {
    for (; !stopping_; absl::SleepFor(absl::Milliseconds(1))) {
      FileDescriptor client(
          accept4(listening_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (client.valid()) {
        auto host = ConnectTcp("127.0.0.1", host_port_, absl::Seconds(5));
        if (host.ok()) connections_.push_back({std::move(client), *std::move(host), {}});
      }
      connections_.remove_if([this](Connection& connection) { return !Pass(connection); });
    }
  }

  // Whether the connection lasts.
  bool Pass(Connection& connection) const {
    const auto asked = ReceiveSome(connection.client);
    if (!asked.ok() || !SendAll(connection.host, *asked, absl::Seconds(5)).ok()) return false;
    const auto answered = ReceiveSome(connection.host);
    if (!answered.ok()) return false;
    const absl::Duration now = RunningNow();
    auto& under_way = connection.under_way;
    if (!answered->empty())
      under_way.emplace_back(now + absl::Nanoseconds(delay_ns_.load()), *answered);
    for (; !under_way.empty() && under_way.front().first <= now; under_way.pop_front()) {
      if (!SendAll(connection.client, under_way.front().second, absl::Seconds(5)).ok()) {
        return false;
      }
    }
    return true;
  }

  const int host_port_;
  const FileDescriptor listening_;
  std::atomic<int64_t> delay_ns_ = 0;
  std::atomic<bool> stopping_ = false;
  std::list<Connection> connections_;
  std::thread thread_;
};

}  // namespace silhouette
