// What `run` says of a plan and of a capture.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "capture/session/capture_plan.h"
#include "capture/session/capture_report.h"
#include "db/store/collision_index.h"

namespace silhouette {

// What a plan needs of the disk, and what there is.
struct DiskRoom {
  uint64_t raw_bytes = 0;             // about, for raw images
  std::optional<uint64_t> available;  // nothing if that is not known
  uint64_t keep_free = 0;

  // Whether `plan` is sure to fit, as far as is known.
  bool Suffices(const CapturePlan& plan) const;
};

std::string PlanText(const CapturePlan& plan, const DiskRoom& room);
nlohmann::json PlanJson(const CapturePlan& plan, const DiskRoom& room);
// Why a plan does not fit on the disk, and the mend.
std::string TooLittleRoom(const CapturePlan& plan, const DiskRoom& room);

std::string ReportText(const CaptureReport& report);
nlohmann::json ReportJson(const CaptureReport& report);

std::string IndexText(const IndexBuildReport& report);
nlohmann::json IndexJson(const IndexBuildReport& report);

}  // namespace silhouette
