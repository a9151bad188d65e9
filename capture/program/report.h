// What `run` says of a plan and of a capture.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "capture/capture_plan.h"
#include "capture/capture_report.h"
#include "db/collision_index.h"

namespace silhouette {

// `available`: bytes free on the database's disk; nothing if that is not known.
std::string PlanText(const CapturePlan& plan, std::optional<uint64_t> available);
nlohmann::json PlanJson(const CapturePlan& plan, std::optional<uint64_t> available);

std::string ReportText(const CaptureReport& report);
nlohmann::json ReportJson(const CaptureReport& report);

std::string IndexText(const IndexBuildReport& report);
nlohmann::json IndexJson(const IndexBuildReport& report);

}  // namespace silhouette
