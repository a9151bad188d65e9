// SPDX-License-Identifier: Apache-2.0
// A way to a server at whose end the machine can vanish without a word: connections stay open, and
// nothing comes over them any more.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace silhouette {

class VanishingProxy {
 public:
  // `server`: "127.0.0.1:port".
  explicit VanishingProxy(const std::string& server)
      : server_(AddressOf(std::stoi(server.substr(server.rfind(':') + 1)))) {
    Return();
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) Forward();
    });
  }
  ~VanishingProxy() {
    thread_.request_stop();
    thread_.join();
    Vanish();
    for (const int client : deserted_) close(client);
  }
  VanishingProxy(const VanishingProxy&) = delete;
  VanishingProxy& operator=(const VanishingProxy&) = delete;

  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

  // The server sees its connections end; the clients see nothing, and nobody new is let in.
  void Vanish() {
    const std::lock_guard lock(mutex_);
    for (const Connection& connection : connections_) {
      close(connection.server);
      deserted_.push_back(connection.client);
    }
    connections_.clear();
    if (listener_ >= 0) close(listener_);
    listener_ = -1;
  }

  // New connections are let in, at the same address.
  void Return() {
    const std::lock_guard lock(mutex_);
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int yes = 1;
    setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    sockaddr_in at = AddressOf(port_);
    EXPECT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&at), sizeof(at)), 0);
    EXPECT_EQ(listen(listener_, 16), 0);
    socklen_t size = sizeof(at);
    EXPECT_EQ(getsockname(listener_, reinterpret_cast<sockaddr*>(&at), &size), 0);
    port_ = ntohs(at.sin_port);
  }

 private:
  struct Connection {
    int client = -1;
    int server = -1;
  };

  static sockaddr_in AddressOf(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
  }

  // Waits a moment for what comes, and passes it on.
  void Forward() {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const std::lock_guard lock(mutex_);
    if (listener_ >= 0 && Readable(listener_)) Accept();
    std::erase_if(connections_, [](const Connection& connection) {
      const bool open = PassOn(connection.client, connection.server) &&
                        PassOn(connection.server, connection.client);
      if (open) return false;
      close(connection.client);
      close(connection.server);
      return true;
    });
  }

  void Accept() {
    const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client < 0) return;
    const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (connect(server, reinterpret_cast<const sockaddr*>(&server_), sizeof(server_)) != 0) {
      close(server);
      close(client);
      return;
    }
    connections_.push_back({.client = client, .server = server});
  }

  static bool Readable(int socket) {
    pollfd look{.fd = socket, .events = POLLIN, .revents = 0};
    return poll(&look, 1, 0) == 1;
  }

  // Whether the connection goes on.
  static bool PassOn(int from, int to) {
    if (!Readable(from)) return true;
    std::array<char, 65536> bytes;
    const ssize_t count = recv(from, bytes.data(), bytes.size(), 0);
    if (count <= 0) return false;
    for (ssize_t sent = 0; sent < count;) {
      const ssize_t now =
          send(to, bytes.data() + sent, static_cast<size_t>(count - sent), MSG_NOSIGNAL);
      if (now <= 0) return false;
      sent += now;
    }
    return true;
  }

  const sockaddr_in server_;
  std::mutex mutex_;
  int port_ = 0;
  int listener_ = -1;
  std::vector<Connection> connections_;
  std::vector<int> deserted_;  // connections of clients that nobody is at the end of
  std::jthread thread_;
};

}  // namespace silhouette
