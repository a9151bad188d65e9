// SPDX-License-Identifier: Apache-2.0
// When robot images were captured that cannot be trusted.
#pragma once

#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

absl::Time TimeOf(const google::protobuf::Timestamp& stamp);

// The spans of time in which a cell may have changed, by what its sessions noticed. A robot image
// captured in one of them is suspect until it is captured again. A span from 1970 on has no
// beginning: imported images may have that time, for none. Cannot be changed once made.
class SuspectSpans {
 public:
  SuspectSpans() = default;
  explicit SuspectSpans(const storage::v1::CaptureHistory& history);

  bool empty() const { return spans_.empty(); }
  bool Contain(absl::Time captured) const;

  // As far as they hold images that were captured until `last`.
  SuspectSpans Until(absl::Time last) const;

  bool operator==(const SuspectSpans&) const = default;

 private:
  std::vector<std::pair<absl::Time, absl::Time>> spans_;  // after the first, up to the second
};

}  // namespace silhouette
