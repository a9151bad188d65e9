#include "tools/silhouette-experiments/found_calibration.h"

#include <utility>

#include "db/status/status_macros.h"
#include "tools/silhouette-db/calibration_files/calibration_files.h"
#include "tools/silhouette-db/calibration_files/tested_calibration.h"

namespace silhouette {

absl::StatusOr<Calibration> FoundCalibration(const std::string& path, const Database& database,
                                             double margin) {
  ASSIGN_OR_RETURN(const auto stored, ReadCalibration({path}, database.cell()));
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(auto tested, TestCalibration(database, snapshot, stored, margin));
  RETURN_IF_ERROR(CheckContradictions(tested.contradictions, database.cell()));
  return std::move(tested.calibration);
}

}  // namespace silhouette
