// SPDX-License-Identifier: Apache-2.0
// The files of a calibration beside its camera models: what `silhouette-db calibration import`
// reads.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/fundamental/view_pairs.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// A figure of merit, in place of one of the same name that is there. `of`: the view or pair; empty:
// of all.
void SetFigure(const std::string& what, const std::string& of, double value, const char* unit,
               storage::v1::CalibrationRecord& record);

struct FoundCalibration {
  // The size of their masks may be unknown (0): then there are no matrices.
  const std::vector<PairedView>& views;
  const std::vector<PairResult>& pairs;
  std::string cameras;  // folder of the camera models; empty: weak calibration
};

// Matrices that are not refused, as silhouette-db reads them. FailedPrecondition if there is none.
absl::Status WriteMatrices(const FoundCalibration& found, const std::string& file);

// calibration.yaml (calib/files/calibration_session_file.h). `record`: by what it was made,
// figures, warnings and fixed tags; figures and warnings of the pairs are added, those of the same
// name replaced, and the time where it has none. FailedPrecondition if there are neither cameras
// nor matrices.
absl::Status WriteCalibrationFile(const FoundCalibration& found,
                                  storage::v1::CalibrationRecord record, const std::string& file);

// The record of the calibration.yaml that is there already, if it is of the same camera files.
std::optional<storage::v1::CalibrationRecord> RecordOfFile(const FoundCalibration& found,
                                                           const std::string& file);

// Puts tags that stay in the cell, as they were seen, into a record in place of those that are
// there. InvalidArgument if one does not stay, or is seen by a view that is not there.
absl::Status SetFixedTags(const FoundCalibration& found, std::span<const TagSighting> fixed,
                          storage::v1::CalibrationRecord& record);

}  // namespace silhouette
