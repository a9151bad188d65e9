// SPDX-License-Identifier: Apache-2.0
// How long the network takes to and from the host of an RTSP stream.
#pragma once

#include <optional>
#include <string>

#include "absl/time/time.h"

namespace silhouette {

// How long a request OPTIONS to the host of `url`, over TCP, and its answer are under way together:
// no less than what is sent from there is under way now. The least of up to three. Nothing: there
// is no answer within `timeout`, or the stream is encrypted (rtsps://).
std::optional<absl::Duration> RtspRoundTrip(const std::string& url, absl::Duration timeout);

// rtsp://user:password@host/path without user and password.
std::string WithoutPassword(const std::string& url);

}  // namespace silhouette
