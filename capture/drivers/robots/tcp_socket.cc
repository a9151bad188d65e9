// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/robots/tcp_socket.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>

#include "absl/strings/str_cat.h"
#include "capture/devices/running_clock.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using AddressList = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;

absl::StatusOr<AddressList> Resolve(const std::string& host, int port) {
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &wanted, &found);
  if (error == 0) return AddressList(found, freeaddrinfo);
  return absl::InvalidArgumentError(
      absl::StrCat("the host '", host, "' is not known: ", gai_strerror(error)));
}

absl::Status Lost(const std::string& what) {
  return absl::UnavailableError(absl::StrCat(what, ": ", std::strerror(errno)));
}

// Whether `events` came within `timeout`.
bool WaitFor(int fd, int16_t events, absl::Duration timeout) {
  pollfd place{.fd = fd, .events = events, .revents = 0};
  const absl::Duration end = RunningNow() + timeout;
  while (true) {
    const auto left =
        absl::ToInt64Milliseconds(absl::Ceil(end - RunningNow(), absl::Milliseconds(1)));
    const int ready = poll(&place, 1, static_cast<int>(std::max<int64_t>(left, 0)));
    if (ready >= 0 || errno != EINTR) return ready > 0;
  }
}

}  // namespace

FileDescriptor::~FileDescriptor() {
  if (fd_ >= 0) close(fd_);
}

std::string AddressOf(const std::string& host, int port) { return absl::StrCat(host, ":", port); }

absl::StatusOr<FileDescriptor> ConnectTcp(const std::string& host, int port,
                                          absl::Duration timeout) {
  ASSIGN_OR_RETURN(const AddressList addresses, Resolve(host, port));
  int error = 0;
  for (const addrinfo* at = addresses.get(); at != nullptr; at = at->ai_next) {
    FileDescriptor socket(
        ::socket(at->ai_family, at->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, at->ai_protocol));
    error = errno;
    if (!socket.valid()) continue;
    const int on = 1;
    setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    if (connect(socket.get(), at->ai_addr, at->ai_addrlen) == 0) return socket;
    error = errno;
    if (error != EINPROGRESS) continue;
    error = ETIMEDOUT;
    if (!WaitFor(socket.get(), POLLOUT, timeout)) continue;
    socklen_t size = sizeof(error);
    getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &error, &size);
    if (error == 0) return socket;
  }
  return absl::UnavailableError(absl::StrCat("there is no connection to ", AddressOf(host, port),
                                             ": ", std::strerror(error)));
}

absl::StatusOr<FileDescriptor> ListenTcp(const std::string& host, int port) {
  ASSIGN_OR_RETURN(const AddressList addresses, Resolve(host, port));
  const addrinfo& at = *addresses;
  FileDescriptor socket(
      ::socket(at.ai_family, at.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, at.ai_protocol));
  const int on = 1;
  if (socket.valid()) setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  if (!socket.valid() || bind(socket.get(), at.ai_addr, at.ai_addrlen) != 0 ||
      listen(socket.get(), 8) != 0) {
    return Lost(absl::StrCat("cannot listen on ", AddressOf(host, port)));
  }
  return socket;
}

int PortOf(const FileDescriptor& listening) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(listening.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  if (address.ss_family == AF_INET6) {
    return ntohs(reinterpret_cast<const sockaddr_in6*>(&address)->sin6_port);
  }
  return ntohs(reinterpret_cast<const sockaddr_in*>(&address)->sin_port);
}

absl::Status SendAll(const FileDescriptor& socket, std::span<const uint8_t> bytes,
                     absl::Duration timeout) {
  while (!bytes.empty()) {
    const ssize_t sent = send(socket.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      bytes = bytes.subspan(static_cast<size_t>(sent));
    } else if (errno == EAGAIN) {
      if (!WaitFor(socket.get(), POLLOUT, timeout)) {
        return absl::UnavailableError("the connection takes no more bytes");
      }
    } else if (errno != EINTR) {
      return Lost("the connection is lost");
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<uint8_t>> ReceiveSome(const FileDescriptor& socket) {
  std::vector<uint8_t> bytes(4096);
  while (true) {
    const ssize_t received = recv(socket.get(), bytes.data(), bytes.size(), 0);
    if (received > 0) {
      bytes.resize(static_cast<size_t>(received));
      return bytes;
    }
    if (received == 0) return absl::UnavailableError("the other side has closed the connection");
    if (errno == EAGAIN) return std::vector<uint8_t>();
    if (errno != EINTR) return Lost("the connection is lost");
  }
}

}  // namespace silhouette
