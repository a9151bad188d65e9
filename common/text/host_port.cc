// SPDX-License-Identifier: Apache-2.0
#include "common/text/host_port.h"

#include <charconv>

namespace silhouette {

std::string HostPort::Text() const {
  const bool is_ipv6 = host.find(':') != std::string::npos;
  return (is_ipv6 ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

std::optional<HostPort> ParseHostPort(std::string_view text) {
  const size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) return std::nullopt;
  std::string_view host = text.substr(0, colon);
  const std::string_view digits = text.substr(colon + 1);
  HostPort address;
  const char* const end = digits.data() + digits.size();
  const auto [read, error] = std::from_chars(digits.data(), end, address.port);
  if (error != std::errc() || read != end || address.port < 0 || address.port > 65535) {
    return std::nullopt;
  }
  const bool in_brackets = host.starts_with('[') && host.ends_with(']');
  if (in_brackets) host = host.substr(1, host.size() - 2);
  const bool is_ipv6 = host.find(':') != std::string_view::npos;
  if (host.empty() || is_ipv6 != in_brackets) return std::nullopt;
  address.host = host;
  return address;
}

}  // namespace silhouette
