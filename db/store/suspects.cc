// SPDX-License-Identifier: Apache-2.0
#include "db/store/suspects.h"

#include <algorithm>

namespace silhouette {

absl::Time TimeOf(const google::protobuf::Timestamp& stamp) {
  return absl::FromUnixSeconds(stamp.seconds()) + absl::Nanoseconds(stamp.nanos());
}

SuspectSpans::SuspectSpans(const storage::v1::CaptureHistory& history) {
  for (const storage::v1::SuspectSpan& span : history.suspects()) {
    const absl::Time after = TimeOf(span.after());
    spans_.emplace_back(after > absl::UnixEpoch() ? after : absl::InfinitePast(),
                        TimeOf(span.until()));
  }
}

bool SuspectSpans::Contain(absl::Time captured) const {
  return std::ranges::any_of(
      spans_, [&](const auto& span) { return captured > span.first && captured <= span.second; });
}

SuspectSpans SuspectSpans::Until(absl::Time last) const {
  SuspectSpans until = *this;
  std::erase_if(until.spans_, [&](const auto& span) { return span.first >= last; });
  for (auto& [after, end] : until.spans_) end = std::min(end, last);
  return until;
}

}  // namespace silhouette
