// SPDX-License-Identifier: Apache-2.0
// What the log says of something that fails and recovers: each kind of fault once, and not each
// time.
#pragma once

#include <set>

#include "absl/time/time.h"

namespace silhouette {

// Not thread-safe.
template <typename Kind>
class FaultLog {
 public:
  // It has recovered when it was good for so long: faults that come again sooner are one.
  static constexpr absl::Duration kRecovered = absl::Seconds(10);

  enum class News { kNone, kFault, kRecovered };

  // How it went at the moment `running`: the kinds of its faults, none if it was good. What to log:
  // kFault, if one of the kinds has not been logged since it last recovered.
  News Note(const std::set<Kind>& faults, absl::Duration running) {
    if (faults.empty()) {
      if (logged_.empty() || running - last_fault_ < kRecovered) return News::kNone;
      logged_.clear();
      return News::kRecovered;
    }
    last_fault_ = running;
    const size_t before = logged_.size();
    logged_.insert(faults.begin(), faults.end());
    return logged_.size() > before ? News::kFault : News::kNone;
  }

 private:
  std::set<Kind> logged_;  // empty: it is good
  absl::Duration last_fault_;
};

}  // namespace silhouette
