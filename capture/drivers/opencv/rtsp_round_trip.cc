// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/opencv/rtsp_round_trip.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/robots/tcp_socket.h"

namespace silhouette {
namespace {

constexpr int kRtspPort = 554;
// A round trip need not be measured better than this.
constexpr absl::Duration kQuick = absl::Milliseconds(20);
constexpr int kMostRequests = 3;

size_t BeginOfHost(const std::string& url) {
  const size_t begin = url.find("://") + 3;
  const size_t at = url.substr(0, url.find_first_of("/?#", begin)).rfind('@');
  return at == std::string::npos ? begin : at + 1;
}

// One request on a connection of its own, so that no answer is taken for that of another.
std::optional<absl::Duration> OneRoundTrip(const std::string& host, int port,
                                           const std::string& request, absl::Duration end) {
  const auto socket = ConnectTcp(host, port, end - RunningNow());
  if (!socket.ok()) return std::nullopt;
  const absl::Duration sent = RunningNow();
  const std::span bytes(reinterpret_cast<const uint8_t*>(request.data()), request.size());
  if (!SendAll(*socket, bytes, end - sent).ok()) return std::nullopt;
  while (RunningNow() < end) {
    const absl::StatusOr<std::vector<uint8_t>> answer = ReceiveSome(*socket);
    if (!answer.ok()) return std::nullopt;
    if (!answer->empty()) return RunningNow() - sent;
    absl::SleepFor(absl::Milliseconds(1));
  }
  return std::nullopt;
}

}  // namespace

std::optional<absl::Duration> RtspRoundTrip(const std::string& url, absl::Duration timeout) {
  if (!url.starts_with("rtsp://")) return std::nullopt;
  const size_t begin = BeginOfHost(url);
  std::string host = url.substr(begin, url.find_first_of("/?#", begin) - begin);
  int port = kRtspPort;
  const size_t colon = host.rfind(':');
  if (colon != std::string::npos && host.find(']', colon) == std::string::npos) {
    if (!absl::SimpleAtoi(host.substr(colon + 1), &port)) return std::nullopt;
    host.resize(colon);
  }
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  const std::string request =
      absl::StrCat("OPTIONS ", WithoutPassword(url), " RTSP/1.0\r\nCSeq: 1\r\n\r\n");
  const absl::Duration end = RunningNow() + timeout;
  std::optional<absl::Duration> least;
  for (int i = 0; i < kMostRequests && !(least && *least <= kQuick); ++i) {
    const auto took = OneRoundTrip(host, port, request, end);
    if (!took) break;
    least = std::min(least.value_or(*took), *took);
  }
  return least;
}

std::string WithoutPassword(const std::string& url) {
  return url.substr(0, url.find("://") + 3) + url.substr(BeginOfHost(url));
}

}  // namespace silhouette
