// The files that `silhouette-calibrate fundamental` writes.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/program/fundamental_pairs.h"

namespace silhouette {

struct FoundCalibration {
  const std::vector<PairedView>& views;
  const std::vector<PairResult>& pairs;
  std::string cameras;  // folder of the camera models; empty: weak calibration
};

// Matrices that are not refused, as silhouette-db reads them. FailedPrecondition if there is none.
absl::Status WriteMatrices(const FoundCalibration& found, const std::string& file);

// calibration.yaml (calib/calibration_session_file.h). `fixed`: sightings of tags that stay in the
// cell; InvalidArgument if one does not.
absl::Status WriteSession(const FoundCalibration& found, std::span<const TagSighting> fixed,
                          const std::string& file);

}  // namespace silhouette
