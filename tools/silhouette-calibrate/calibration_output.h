// SPDX-License-Identifier: Apache-2.0
// The files of a calibration beside its camera models: what `silhouette-db calibration import`
// reads.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/fundamental/view_pairs.h"
#include "server/scene/scene_settings.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Mask pixels by which a camera may have moved: what the server's margin leaves for moves, if the
// calibration itself errs by no more than 0.05. Cameras that all moved by m need a margin of m.
inline constexpr double kMostMoved = CalibrationSettings{}.margin - 0.05;

// Sets a figure of merit; replaces one of the same name. `of`: the view or pair; empty: all.
void SetFigure(const std::string& what, const std::string& of, double value, const char* unit,
               storage::v1::CalibrationRecord& record);

struct FoundCalibration {
  // The size of their masks may be unknown (0): then there are no matrices.
  std::vector<PairedView> views;
  std::vector<PairResult> pairs;
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

// The record of an existing calibration.yaml, if it names the same camera files. An existing file
// that is no calibration.yaml of these views: the errors of its readers, with the mend.
absl::StatusOr<std::optional<storage::v1::CalibrationRecord>> RecordOfFile(
    const FoundCalibration& found, const std::string& file);

// Replaces the record's fixed tags, those that stay in the cell. InvalidArgument if a tag moved
// between frames, or if its view is not among `found.views`.
absl::Status SetFixedTags(const FoundCalibration& found, std::span<const TagSighting> fixed,
                          storage::v1::CalibrationRecord& record);

// Compares the camera models with fixed tags that two views see. FailedPrecondition if corners are
// more than kMostMoved off their epipolar lines: a camera moved since it was calibrated. A move
// along the lines does not show. Gives the views that share no tag with another, of which nothing
// is known. All views have cameras and masks' sizes; the tags are as SetFixedTags takes them.
absl::StatusOr<std::vector<std::string>> CompareWithCameras(const FoundCalibration& found,
                                                            std::span<const TagSighting> fixed);

}  // namespace silhouette
