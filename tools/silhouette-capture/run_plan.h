// What `run` is asked to capture, and the plan that it makes of it.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "capture/session/capture_plan.h"
#include "capture/session/travel.h"
#include "db/store/store.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/report.h"

namespace silhouette {

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
