#include "server/live/fault_log.h"

namespace silhouette {

std::optional<absl::Status> FaultLog::Note(const absl::Status& status, absl::Duration running) {
  if (!status.ok()) {
    last_fault_ = running;
    if (told_.insert(status.code()).second) return status;
    return std::nullopt;
  }
  if (told_.empty() || running - last_fault_ < kRecovered) return std::nullopt;
  told_.clear();
  return absl::OkStatus();
}

}  // namespace silhouette
