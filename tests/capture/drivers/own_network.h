// SPDX-License-Identifier: Apache-2.0
// A network of a test's own: GigE Vision cameras all have the same port, so that each needs an
// address, and tests that run at the same time must not meet each other's.
#pragma once

#include <arpa/inet.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <string>

namespace silhouette {

// Moves this process, which must not have threads yet, and those that it starts to a network of
// their own with nothing but the loopback addresses 127.0.0.1 to 127.0.0.<count>. False: the system
// does not let it.
inline bool EnterOwnNetwork(int count) {
  if (unshare(CLONE_NEWNET) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return false;
  const int socket_fd = socket(AF_INET, SOCK_DGRAM, 0);
  bool done = socket_fd >= 0;
  for (int i = 1; done && i <= count; ++i) {
    const std::string device = i == 1 ? "lo" : "lo:" + std::to_string(i);
    const std::string text = "127.0.0." + std::to_string(i);
    ifreq request{};
    std::strncpy(request.ifr_name, device.c_str(), IFNAMSIZ - 1);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    inet_pton(AF_INET, text.c_str(), &address.sin_addr);
    std::memcpy(&request.ifr_addr, &address, sizeof(address));
    if (i > 1) done = ioctl(socket_fd, SIOCSIFADDR, &request) == 0;
    if (i == 1) {
      request.ifr_flags = IFF_UP | IFF_RUNNING | IFF_LOOPBACK;
      done = ioctl(socket_fd, SIOCSIFFLAGS, &request) == 0;
    }
  }
  if (socket_fd >= 0) close(socket_fd);
  return done;
}

}  // namespace silhouette
