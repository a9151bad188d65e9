// SPDX-License-Identifier: Apache-2.0
#include "server/service/listener.h"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <arpa/inet.h>
#include <fcntl.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/text/host_port.h"
#include "db/status/status_macros.h"

namespace silhouette {

Descriptor::~Descriptor() {
  if (open()) close(number_);
}
Descriptor::Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  std::swap(number_, other.number_);
  return *this;
}

namespace {

constexpr int kBacklog = 128;
constexpr std::chrono::seconds kLogInterval{10};

Descriptor Socket(int family) {
  return Descriptor(socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

absl::Status CannotListen(const std::string& address, const std::string& why) {
  return absl::FailedPreconditionError(absl::StrCat("cannot listen on ", address, ": ", why));
}

// Of "unix:path".
absl::StatusOr<sockaddr_un> UnixName(const std::string& address) {
  const std::string path = address.substr(5);
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof(name.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat("listen address '", address,
                                                   "': the path of a socket has 1 to ",
                                                   sizeof(name.sun_path) - 1, " characters"));
  }
  std::copy(path.begin(), path.end(), name.sun_path);
  return name;
}

absl::Status CheckUnix(const std::string& address) {
  ASSIGN_OR_RETURN(const sockaddr_un name, UnixName(address));
  const std::string path = name.sun_path;
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) {
    const std::string::size_type slash = path.rfind('/');
    const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
    if (access(folder.c_str(), W_OK) == 0) return absl::OkStatus();
    return CannotListen(address, absl::StrCat("the folder '", folder, "': ", strerror(errno)));
  }
  if (!S_ISSOCK(status.st_mode)) {
    return CannotListen(address, "there is a file of this name that is no socket");
  }
  const Descriptor probe = Socket(AF_UNIX);
  if (connect(probe.number(), reinterpret_cast<const sockaddr*>(&name), sizeof(name)) == 0 ||
      errno == EAGAIN) {
    return CannotListen(address, "another server listens there; stop it or choose another path");
  }
  return absl::OkStatus();  // left behind by a server that is gone
}

in_port_t& PortOf(addrinfo& info) {
  return info.ai_family == AF_INET6 ? reinterpret_cast<sockaddr_in6*>(info.ai_addr)->sin6_port
                                    : reinterpret_cast<sockaddr_in*>(info.ai_addr)->sin_port;
}

// Sockets that listen at all addresses of "host:port" that this machine has.
absl::StatusOr<std::vector<Descriptor>> ListenAtHost(const std::string& address) {
  const std::optional<HostPort> parsed = ParseHostPort(address);
  if (!parsed) {
    return absl::InvalidArgumentError(absl::StrCat(
        "listen address '", address, "' is not host:port, as in 127.0.0.1:50051 or [::1]:50051"));
  }
  const std::string& host = parsed->host;
  const std::string port = absl::StrCat(parsed->port);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), port.c_str(), &hints, &found); error != 0) {
    return CannotListen(address, absl::StrCat("host '", host, "': ", gai_strerror(error)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> infos(found, freeaddrinfo);
  int problem = 0;
  in_port_t chosen = htons(static_cast<in_port_t>(parsed->port));
  std::vector<Descriptor> sockets;
  for (addrinfo* info = found; info != nullptr; info = info->ai_next) {
    PortOf(*info) = chosen;
    Descriptor socket = Socket(info->ai_family);
    const int yes = 1;
    setsockopt(socket.number(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    if (bind(socket.number(), info->ai_addr, info->ai_addrlen) != 0 ||
        listen(socket.number(), kBacklog) != 0 ||
        getsockname(socket.number(), info->ai_addr, &info->ai_addrlen) != 0) {
      if (problem != EADDRINUSE) problem = errno;
      continue;
    }
    chosen = PortOf(*info);
    sockets.push_back(std::move(socket));
  }
  if (problem == EADDRINUSE) {
    return CannotListen(address, absl::StrCat("port ", port,
                                              " is in use; stop the program that uses it, or "
                                              "choose another port (0: any free one)"));
  }
  if (sockets.empty()) return CannotListen(address, strerror(problem));
  return sockets;
}

// The client at the other end; "unix" if it is on this machine's own socket.
std::string PeerOf(const sockaddr_storage& peer) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (peer.ss_family == AF_INET) {
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in&>(peer).sin_addr, text.data(),
              text.size());
  } else if (peer.ss_family == AF_INET6) {
    inet_ntop(AF_INET6, &reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr, text.data(),
              text.size());
  } else {
    return "unix";
  }
  return ClientAt(text.data());
}

Descriptor Spare() { return Descriptor(open("/dev/null", O_RDONLY | O_CLOEXEC)); }

}  // namespace

absl::Status CheckListenAddress(const std::string& address) {
  return address.starts_with("unix:") ? CheckUnix(address) : ListenAtHost(address).status();
}

absl::StatusOr<std::unique_ptr<Listener>> Listener::Open(const std::string& address,
                                                         Clients& clients) {
  auto listener = std::unique_ptr<Listener>(new Listener(clients));
  RETURN_IF_ERROR(listener->Listen(address));
  rlimit descriptors{};
  getrlimit(RLIMIT_NOFILE, &descriptors);
  if (descriptors.rlim_cur != RLIM_INFINITY) {
    const int64_t most = (static_cast<int64_t>(descriptors.rlim_cur) - kReserve) / 2;
    clients.LimitConnections(static_cast<int>(std::clamp<int64_t>(most, 1, 1 << 20)));
  }
  return listener;
}

absl::Status Listener::Listen(const std::string& address) {
  address_ = address;
  if (!address.starts_with("unix:")) {
    ASSIGN_OR_RETURN(sockets_, ListenAtHost(address));
    sockaddr_storage name{};
    socklen_t size = sizeof(name);
    getsockname(sockets_.front().number(), reinterpret_cast<sockaddr*>(&name), &size);
    const in_port_t port = name.ss_family == AF_INET6
                               ? reinterpret_cast<sockaddr_in6&>(name).sin6_port
                               : reinterpret_cast<sockaddr_in&>(name).sin_port;
    address_ = HostPort{ParseHostPort(address)->host, ntohs(port)}.Text();
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(CheckUnix(address));
  ASSIGN_OR_RETURN(const sockaddr_un name, UnixName(address));
  unlink(name.sun_path);
  Descriptor socket = Socket(AF_UNIX);
  if (bind(socket.number(), reinterpret_cast<const sockaddr*>(&name), sizeof(name)) != 0 ||
      listen(socket.number(), kBacklog) != 0) {
    return CannotListen(address, strerror(errno));
  }
  sockets_.push_back(std::move(socket));
  return absl::OkStatus();
}

Listener::~Listener() {
  if (thread_.joinable()) {
    eventfd_write(stop_.number(), 1);
    thread_.join();
  }
  if (!sockets_.empty() && address_.starts_with("unix:")) unlink(address_.c_str() + 5);
}

void Listener::Start(Take take) {
  take_ = std::move(take);
  poll_ = Descriptor(epoll_create1(EPOLL_CLOEXEC));
  stop_ = Descriptor(eventfd(0, EFD_CLOEXEC));
  spare_ = Spare();
  const auto watch = [this](int descriptor) {
    epoll_event event{.events = EPOLLIN, .data = {.fd = descriptor}};
    epoll_ctl(poll_.number(), EPOLL_CTL_ADD, descriptor, &event);
  };
  watch(stop_.number());
  for (const Descriptor& socket : sockets_) watch(socket.number());
  thread_ = std::thread([this] { Run(); });
}

void Listener::Run() {
  for (;;) {
    std::array<epoll_event, 64> events;
    const int count = epoll_wait(poll_.number(), events.data(), events.size(), -1);
    for (int i = 0; i < count; ++i) {
      const int descriptor = events[static_cast<size_t>(i)].data.fd;
      if (descriptor == stop_.number()) return;
      if (!connections_.contains(descriptor)) {
        Accept(descriptor);
        continue;
      }
      // Of a connection only its end is watched for. gRPC may still hold its own descriptor.
      epoll_ctl(poll_.number(), EPOLL_CTL_DEL, descriptor, nullptr);
      connections_.erase(descriptor);
    }
  }
}

void Listener::Accept(int listener) {
  sockaddr_storage peer{};
  socklen_t size = sizeof(peer);
  Descriptor accepted(
      accept4(listener, reinterpret_cast<sockaddr*>(&peer), &size, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (!accepted.open()) {
    if (errno == EMFILE || errno == ENFILE) Drop(listener);
    return;
  }
  absl::StatusOr<Clients::Place> place = clients_.Connection(PeerOf(peer));
  if (!place.ok()) return LogRefusal(place.status());
  const int yes = 1;
  if (peer.ss_family != AF_UNIX) {
    setsockopt(accepted.number(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
  }
  Descriptor duplicate(fcntl(accepted.number(), F_DUPFD_CLOEXEC, 0));
  if (!duplicate.open()) return;
  const int number = duplicate.number();
  epoll_event event{.events = 0, .data = {.fd = number}};  // its end is reported all the same
  epoll_ctl(poll_.number(), EPOLL_CTL_ADD, number, &event);
  connections_[number] = {std::move(duplicate), *std::move(place)};
  take_(listener, accepted.Release());
}

void Listener::LogRefusal(const absl::Status& why) {
  const auto now = std::chrono::steady_clock::now();
  if (now - logged_ < kLogInterval) return;
  logged_ = now;
  spdlog::warn("a connection is refused: {}", std::string(why.message()));
}

void Listener::Drop(int listener) {
  spare_ = Descriptor();
  Descriptor(accept4(listener, nullptr, nullptr, SOCK_CLOEXEC));
  spare_ = Spare();
}

}  // namespace silhouette
