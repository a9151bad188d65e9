// SPDX-License-Identifier: Apache-2.0
// Network addresses as people write them.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace silhouette {

// An address of TCP.
struct HostPort {
  std::string host;  // a name or a number, of IPv6 without brackets
  int port = 0;

  // As it stands in a URL: 127.0.0.1:8080 or [::1]:8080.
  std::string Text() const;
};

// "host:port", an IPv6 number in brackets; ports are 0 to 65535. Nothing for everything else, also
// for "::1:8080", which could be a host alone.
std::optional<HostPort> ParseHostPort(std::string_view text);

}  // namespace silhouette
