// SPDX-License-Identifier: Apache-2.0
// What `run` is asked to capture, and the plan that it makes of it.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "capture/session/capture_plan.h"
#include "capture/session/capture_report.h"
#include "capture/session/travel.h"
#include "db/store/collision_index.h"
#include "db/store/store.h"
#include "tools/silhouette-capture/opened_cell.h"

namespace silhouette {

// What `run` says of a plan and of a capture.

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

struct PlanArguments {
  // "missing", "outliers", "suspect", "all", "sentinels", or configuration numbers with commas.
  std::string only = "missing";
  bool exclude_captured = false;
  bool new_sentinels = false;
};

// Whether PlanArguments::only is one of these; the error says what is expected.
std::string CheckOnly(const std::string& only);

// `database` may be null: there is none yet.
absl::StatusOr<CapturePlan> MakePlan(const PlanArguments& arguments,
                                     const CellArguments& cell_arguments, const Cell& cell,
                                     const Travel& travel, const Database* database);

// What a plan needs of the disk, and what there is.
DiskRoom RoomFor(const CapturePlan& plan, const CellFile& file, const Database* database);

}  // namespace silhouette
