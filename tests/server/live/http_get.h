// SPDX-License-Identifier: Apache-2.0
// A web page, fetched as a browser does.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

namespace silhouette {

// What http://ADDRESS/PATH answers, its head included; `address` is "127.0.0.1:PORT" or
// "[::1]:PORT".
inline std::string HttpGet(const std::string& address, const std::string& path) {
  const auto port = static_cast<uint16_t>(std::stoi(address.substr(address.rfind(':') + 1)));
  sockaddr_in name{};
  name.sin_family = AF_INET;
  name.sin_port = htons(port);
  name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  sockaddr_in6 name6{};
  name6.sin6_family = AF_INET6;
  name6.sin6_port = htons(port);
  name6.sin6_addr = in6addr_loopback;
  const bool is_ipv6 = address.starts_with('[');
  const auto* const to = is_ipv6 ? reinterpret_cast<const sockaddr*>(&name6)
                                 : reinterpret_cast<const sockaddr*>(&name);
  const int descriptor = socket(to->sa_family, SOCK_STREAM, 0);
  std::string answer;
  if (connect(descriptor, to, is_ipv6 ? sizeof(name6) : sizeof(name)) == 0) {
    const std::string question =
        "GET " + path + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    EXPECT_EQ(write(descriptor, question.data(), question.size()),
              static_cast<ssize_t>(question.size()));
    char part[4096];
    for (ssize_t got = read(descriptor, part, sizeof(part)); got > 0;
         got = read(descriptor, part, sizeof(part))) {
      answer.append(part, static_cast<size_t>(got));
    }
  }
  close(descriptor);
  return answer;
}

}  // namespace silhouette
