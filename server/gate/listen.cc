// SPDX-License-Identifier: Apache-2.0
// Where plain text may be spoken, and the file of a Unix socket.
#include <arpa/inet.h>
#include <grp.h>
#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>

#include "absl/strings/str_cat.h"
#include "common/text/host_port.h"
#include "db/status/status_macros.h"
#include "server/gate/credentials.h"

namespace silhouette {
namespace {

constexpr char kUnix[] = "unix:";

bool IsLoopback(const sockaddr& address) {
  if (address.sa_family == AF_INET) {
    const auto& ip = reinterpret_cast<const sockaddr_in&>(address).sin_addr;
    return (ntohl(ip.s_addr) >> 24) == 127;
  }
  if (address.sa_family != AF_INET6) return false;
  const auto& ip = reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
  return IN6_IS_ADDR_LOOPBACK(&ip) != 0;
}

}  // namespace

bool StaysOnThisMachine(const std::string& address) {
  const auto parsed = ParseHostPort(address);
  if (!parsed) return false;
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(parsed->host.c_str(), nullptr, &hints, &found) != 0) return false;
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> infos(found, freeaddrinfo);
  for (const addrinfo* info = found; info != nullptr; info = info->ai_next) {
    if (!IsLoopback(*info->ai_addr)) return false;
  }
  return found != nullptr;
}

absl::Status CheckGate(const std::string& address, const GateSettings& settings) {
  const bool unix_socket = address.starts_with(kUnix);
  if (settings.tls && unix_socket) {
    return InvalidArgument("server: tls is for host:port; the Unix socket ", address.substr(5),
                           " is guarded by socket_mode and socket_group, and 'roles' name users");
  }
  if (!unix_socket && (settings.socket_mode || !settings.socket_group.empty())) {
    return InvalidArgument("server: socket_mode and socket_group are for unix:path, not for ",
                           address);
  }
  if (settings.tls && settings.roles.empty()) {
    return InvalidArgument(
        "server: tls needs 'roles', e.g. {planner: [planner-1]}: the names in certificates and "
        "what they may do");
  }
  if (!settings.tls && !unix_socket && !settings.roles.empty()) {
    return InvalidArgument(
        "server: roles need 'tls', where the certificate says who calls, or 'listen: unix:PATH', "
        "where the system does");
  }
  if (settings.tls || settings.insecure || unix_socket || StaysOnThisMachine(address)) {
    return absl::OkStatus();
  }
  return FailedPrecondition(
      "will not speak plain text on ", address,
      ", which other machines reach: state 'server: tls' in the cell file, listen on 127.0.0.1, or "
      "start with --insecure if everyone in that network may do everything");
}

absl::Status GuardSocket(const std::string& address, const GateSettings& settings) {
  if (!address.starts_with(kUnix)) return absl::OkStatus();
  const std::string path = address.substr(5);
  if (!settings.socket_group.empty()) {
    const group* const found = getgrnam(settings.socket_group.c_str());
    if (found == nullptr) {
      return FailedPrecondition("socket_group: there is no group '", settings.socket_group, "'");
    }
    if (chown(path.c_str(), static_cast<uid_t>(-1), found->gr_gid) != 0) {
      return FailedPrecondition("cannot give the socket '", path, "' to the group '",
                                settings.socket_group, "': ", strerror(errno),
                                "; run the server as a member of it");
    }
  }
  if (chmod(path.c_str(), settings.socket_mode.value_or(0660)) != 0) {
    return FailedPrecondition("cannot set the mode of the socket '", path, "': ", strerror(errno));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
