#include "server/service/listen_address.h"

#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

class Socket {
 public:
  explicit Socket(int family) : descriptor_(socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0)) {}
  ~Socket() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

absl::Status CannotListen(const std::string& address, const std::string& why) {
  return absl::FailedPreconditionError(absl::StrCat("cannot listen on ", address, ": ", why));
}

absl::Status CheckUnixPath(const std::string& address, const std::string& path) {
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof(name.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat("listen address '", address,
                                                   "': the path of a socket has 1 to ",
                                                   sizeof(name.sun_path) - 1, " characters"));
  }
  std::copy(path.begin(), path.end(), name.sun_path);
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
  const Socket probe(AF_UNIX);
  if (connect(probe.descriptor(), reinterpret_cast<const sockaddr*>(&name), sizeof(name)) == 0) {
    return CannotListen(address, "another server listens there; stop it or choose another path");
  }
  return absl::OkStatus();  // left behind by a server that is gone
}

// errno of listening on one of a host's addresses; 0 if it works.
int ProblemOf(const addrinfo& info) {
  const Socket probe(info.ai_family);
  if (probe.descriptor() < 0) return errno;
  const int yes = 1;
  setsockopt(probe.descriptor(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  return bind(probe.descriptor(), info.ai_addr, info.ai_addrlen) == 0 ? 0 : errno;
}

absl::Status CheckHostAndPort(const std::string& address, std::string host,
                              const std::string& port) {
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), port.c_str(), &hints, &found); error != 0) {
    return CannotListen(address, absl::StrCat("host '", host, "': ", gai_strerror(error)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> infos(found, freeaddrinfo);
  int problem = 0;
  bool works = false;
  for (const addrinfo* info = found; info != nullptr; info = info->ai_next) {
    const int error = ProblemOf(*info);
    works = works || error == 0;
    if (problem != EADDRINUSE && error != 0) problem = error;
  }
  if (problem == EADDRINUSE) {
    return CannotListen(address, absl::StrCat("port ", port,
                                              " is in use; stop the program that uses it, or "
                                              "choose another port (0: any free one)"));
  }
  return works ? absl::OkStatus() : CannotListen(address, strerror(problem));
}

}  // namespace

absl::Status CheckListenAddress(const std::string& address) {
  if (address.starts_with("unix:")) return CheckUnixPath(address, address.substr(5));
  const std::string::size_type colon = address.rfind(':');
  int port = 0;
  if (colon == std::string::npos || colon == 0 ||
      !absl::SimpleAtoi(address.substr(colon + 1), &port) || port < 0 || port > 65535) {
    return absl::InvalidArgumentError(absl::StrCat("listen address '", address,
                                                   "' is not like 127.0.0.1:50051, [::1]:50051 or "
                                                   "unix:/run/silhouette.sock"));
  }
  return CheckHostAndPort(address, address.substr(0, colon), address.substr(colon + 1));
}

}  // namespace silhouette
