// SPDX-License-Identifier: Apache-2.0
// Time spans as people write and read them, the same on command lines, in files and in messages.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "absl/time/time.h"

namespace silhouette {

// What ParseTime takes, for messages.
inline constexpr char kTimeExamples[] =
    "seconds, or e.g. '250 ms', '1 min 30 s' or '2 h' (units: ms, s, min, h)";

// "250 ms", "30s", "1 min 30 s" or "1.5 h"; a number without a unit is seconds. Not negative.
// Nothing for everything else, also for "m", which could be minutes or milliseconds.
std::optional<absl::Duration> ParseTime(std::string_view text);

// "250 ms", "1.5 s", "6 min 32 s", "2 h 5 min": below a minute to five digits, above it to the
// second, above a day to the minute, rounded towards zero. ParseTime takes it.
std::string SpokenTime(absl::Duration time);

// A time that is longer than `limit`, for a message that states both: as above, but in whole
// seconds (below a minute milliseconds), rounded up, if both would read the same.
std::string SpokenTimeAbove(absl::Duration limit, absl::Duration time);

}  // namespace silhouette
