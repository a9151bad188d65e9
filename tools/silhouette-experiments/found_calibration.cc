#include "tools/silhouette-experiments/found_calibration.h"

#include <utility>

#include "tools/silhouette-db/calibration_files/calibration_files.h"
#include "tools/silhouette-db/calibration_files/tested_calibration.h"

namespace silhouette {

absl::StatusOr<Calibration> FoundCalibration(const std::string& path, const Database& database,
                                             double margin) {
  const auto stored = ReadCalibration({path}, database.cell());
  if (!stored.ok()) return stored.status();
  const absl::StatusOr<Snapshot> snapshot = database.Read();
  if (!snapshot.ok()) return snapshot.status();
  auto tested = TestCalibration(database, *snapshot, *stored, margin);
  if (!tested.ok()) return tested.status();
  absl::Status fits = CheckContradictions(tested->contradictions, database.cell());
  if (!fits.ok()) return fits;
  return std::move(tested->calibration);
}

}  // namespace silhouette
