// SPDX-License-Identifier: Apache-2.0
// TCP sockets that close themselves.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace silhouette {

class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int fd) : fd_(fd) {}
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~FileDescriptor();

  int get() const { return fd_; }
  bool valid() const { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

// "host:port"
std::string AddressOf(const std::string& host, int port);

// A connection that does not wait for more bytes to send. Unavailable, naming the address: no
// answer within `timeout`; InvalidArgument: the host is not known.
absl::StatusOr<FileDescriptor> ConnectTcp(const std::string& host, int port,
                                          absl::Duration timeout);

// Listens; port 0: one that is free. InvalidArgument, Unavailable: the address cannot be used.
absl::StatusOr<FileDescriptor> ListenTcp(const std::string& host, int port);
// The port that a socket listens on.
int PortOf(const FileDescriptor& listening);

// Sends all of it. Unavailable: the connection is lost, or takes nothing for `timeout`.
absl::Status SendAll(const FileDescriptor& socket, std::span<const uint8_t> bytes,
                     absl::Duration timeout);

// What has arrived by now; nothing: nothing. Unavailable: the other side has closed the connection,
// or it is lost.
absl::StatusOr<std::vector<uint8_t>> ReceiveSome(const FileDescriptor& socket);

}  // namespace silhouette
