// A calibration that the robot images of a database were asked about.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "db/store/store.h"
#include "server/collision/epipolar_bands.h"
#include "tools/silhouette-db/calibration_files/contradictions.h"

namespace silhouette {

// With its bands, and what the robot images say of them.
struct TestedCalibration {
  Calibration calibration;
  EpipolarBands bands;
  std::vector<ConfigurationNumber> samples;
  Contradictions contradictions;
};

// `margin`: mask pixels by which pixels are widened. InvalidArgument: there are no lines between
// two views (CheckLines). Cancelled after Ctrl-C.
absl::StatusOr<TestedCalibration> TestCalibration(const Database& database,
                                                  const Snapshot& snapshot,
                                                  const storage::v1::Calibration& stored,
                                                  double margin);

// "0.031 % of 12345 robot pixels of 'top' contradict 'left'", the worst pair; or that nothing could
// be looked at.
std::string ContradictionText(const Contradictions& found,
                              const storage::v1::CellDescription& cell);

// FailedPrecondition, with the figures, if more robot pixels contradict than those of a calibration
// of these cameras, as they stood at the capture, may.
absl::Status CheckContradictions(const Contradictions& found,
                                 const storage::v1::CellDescription& cell);

}  // namespace silhouette
