// SPDX-License-Identifier: Apache-2.0
// What the HTTP servers of metrics and page have in common.
#pragma once

#include <httplib.h>
#include <sys/socket.h>

#include <functional>
#include <optional>
#include <semaphore>
#include <utility>

#include "common/text/host_port.h"

namespace silhouette {

// Serves at most `most` connections at a time; further ones wait in the backlog of the socket.
class BoundedThreads final : public httplib::TaskQueue {
 public:
  explicit BoundedThreads(int most) : places_(most), threads_(static_cast<size_t>(most)) {}

  void enqueue(std::function<void()> task) override {
    places_.acquire();
    threads_.enqueue([this, task = std::move(task)] {
      task();
      places_.release();
    });
  }
  void shutdown() override { threads_.shutdown(); }

 private:
  std::counting_semaphore<> places_;
  httplib::ThreadPool threads_;
};

// Binds the socket of a server that is yet to listen, so that no other program shares its port.
// Returns the address with the port that was chosen. Nothing: it cannot be.
inline std::optional<HostPort> BindServer(httplib::Server& server, HostPort address) {
  server.set_socket_options([](int socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  });
  if (address.port == 0) {
    address.port = server.bind_to_any_port(address.host);
  } else if (!server.bind_to_port(address.host, address.port)) {
    return std::nullopt;
  }
  return address.port < 0 ? std::nullopt : std::optional(address);
}

}  // namespace silhouette
