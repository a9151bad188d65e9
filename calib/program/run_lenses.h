// The lenses of a session of `silhouette-calibrate run` to which none were given.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/intrinsics/solve_lenses.h"
#include "calib/program/run_record.h"
#include "silhouette/storage/v1/storage.pb.h"
#include "tools/cell/cell.h"

namespace silhouette {

struct FoundLenses {
  LensSolution solution;
  std::vector<std::string> files;
};

// From what the images show of the boards; writes camera models to `folder`, which is made. The
// errors are SolveLenses', those of writing besides.
absl::StatusOr<FoundLenses> FindLenses(const Cell& cell, const std::vector<Board>& boards,
                                       const SessionRecord& record, const std::string& folder);

// How well they are known, and what was warned of, for calibration.yaml.
storage::v1::CalibrationRecord RecordOf(const LensSolution& solution);

}  // namespace silhouette
