// What is said of something that fails and recovers: once, and not each time.
#pragma once

#include <optional>
#include <set>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace silhouette {

// Not thread-safe.
class FaultLog {
 public:
  // It has recovered when it was good for so long.
  static constexpr absl::Duration kRecovered = absl::Seconds(2);

  // How it went at the moment `running`. What is to be said, if anything: a fault of a kind (status
  // code) that has not been told since it last was good; OK, if it has recovered.
  std::optional<absl::Status> Note(const absl::Status& status, absl::Duration running);

 private:
  std::set<absl::StatusCode> told_;  // empty: it is good
  absl::Duration last_fault_;
};

}  // namespace silhouette
