// The lenses of a session of `silhouette-calibrate run` to which none were given.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/intrinsics/solve_lenses.h"
#include "silhouette/storage/v1/storage.pb.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/run_record.h"
#include "tools/silhouette-calibrate/run_session.h"

namespace silhouette {

struct FoundLenses {
  LensSolution solution;
  std::vector<std::string> files;
};

// From what the images show of the boards, at which it looks twice: corners are better once the
// lenses are known. The better ones take their place in `record` and its file; camera models go to
// the folder `lenses` of the session's. The errors are SolveLenses', those of files besides.
absl::StatusOr<FoundLenses> FindLenses(const Cell& cell, const RobotModel& robot,
                                       const SessionSettings& settings, SessionRecord& record);

// The folder of the camera models.
std::string LensFolder(const std::string& session);

// How well they are known, and what was warned of, for calibration.yaml.
storage::v1::CalibrationRecord RecordOf(const LensSolution& solution);

}  // namespace silhouette
