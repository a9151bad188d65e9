// SPDX-License-Identifier: Apache-2.0
// Accepts the server's connections itself, and hands those within the limits to gRPC. gRPC 1.51 has
// no limit of connections, and stops accepting for good once descriptors run out (CVE-2023-4785).
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/service/clients.h"

namespace silhouette {

// Whether a server can listen on `address`: "host:port", "[::1]:port" or "unix:path"; port 0 stands
// for any free one. InvalidArgument: it is not an address. FailedPrecondition: it is taken, or is
// none of this machine's. The messages say what to do.
absl::Status CheckListenAddress(const std::string& address);

// An open descriptor, closed with this.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept;
  Descriptor& operator=(Descriptor&& other) noexcept;
  int number() const { return number_; }
  // Leaves the closing to the caller.
  int Release() { return std::exchange(number_, -1); }
  bool open() const { return number_ >= 0; }

 private:
  int number_;
};

class Listener {
 public:
  // Takes a connection, non-blocking, and closes it when it is over.
  using Take = std::function<void(int listener, int connection)>;

  // Descriptors that connections leave to the rest of the program.
  static constexpr int kReserve = 200;

  // Listens, but accepts nothing yet. The connections that the process has descriptors for, two for
  // each, bound those of `clients`, which must outlive it. Errors: as CheckListenAddress.
  static absl::StatusOr<std::unique_ptr<Listener>> Open(const std::string& address,
                                                        Clients& clients);
  // Stops listening. Connections that were taken stay.
  ~Listener();

  // From now on accepts. Once.
  void Start(Take take);

  // The address that is listened on, with the port that was chosen.
  const std::string& address() const { return address_; }

 private:
  struct Connection {
    Descriptor descriptor;  // a duplicate: shows when gRPC or the peer has ended it
    Clients::Place place;
  };

  explicit Listener(Clients& clients) : clients_(clients) {}

  absl::Status Listen(const std::string& address);
  void Run();
  void Accept(int listener);
  void LogRefusal(const absl::Status& why);
  // A connection that cannot be taken: without a descriptor for it, it would be offered for ever.
  void Drop(int listener);

  Clients& clients_;
  std::string address_;
  std::vector<Descriptor> sockets_;
  Descriptor poll_;
  Descriptor stop_;
  Descriptor spare_;  // given up for a moment to drop a connection
  Take take_;
  std::map<int, Connection> connections_;  // by their descriptor
  std::chrono::steady_clock::time_point logged_;
  std::thread thread_;
};

}  // namespace silhouette
