// SPDX-License-Identifier: Apache-2.0
// calibration.yaml: all of a calibration in one file beside its cameras' models - the views, how
// they see each other, where it comes from and how good it is.
//
//   calibration: 1                      # version of this format
//   time: 2026-11-21T21:00:00Z          # when it was made
//   program: silhouette-calibrate ...   # by what
//   views:                              # all of the cell's
//     - {name: top, camera: top.cameramodel}   # a file beside this one
//     - {name: left, camera: left.cameramodel}
//   pairs:                              # as in a file of matrices, below
//     - {view_a: top, view_b: left, F: [[0, 0, 0.5], [0, 0, -1], [0.25, 1, 3]]}
//   figures:                            # of merit; `of`: a view, a pair or nothing
//     - {name: corner_rms, of: top, value: 0.031, unit: px}
//   warnings: ["tags were seen in 20 % of the image of 'top' only"]
//   fixed_tags:                         # tags that stay, as the cameras saw them
//     - {view: top, family: tagStandard41h12, tag: 7, sigma: 0.02,
//        corners: [[10, 20], [30, 20], [30, 0], [10, 0]]}
//
// With cameras these are the calibration and the pairs are for information, true of pixels of
// undistorted images; without, the pairs are the calibration.
// Only `calibration` and `views` must be there, and cameras or pairs. Numbers are written so that
// reading gives the same ones.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// What the file is called in a folder of camera models.
inline constexpr char kSessionFileName[] = "calibration.yaml";

struct CalibrationSession {
  // Without cameras where `camera_files` names them; these are for the caller to read and add.
  storage::v1::Calibration calibration;
  // Per view of the cell, relative to the file's folder; empty: the calibration is its matrices.
  std::vector<std::string> camera_files;
};

// `cell`: the names of the views. Of `session.calibration` everything but the cameras is written;
// matrices beside camera files are for information.
std::string SessionFileText(const CalibrationSession& session,
                            const storage::v1::CellDescription& cell);

// Whether a YAML text is such a file rather than a list of matrices: a map.
bool IsSessionFile(const std::string& text);

// `file`: what messages call it. InvalidArgument with file and line: not such a file, another
// version, a view of the cell that is missing or one that it does not have, cameras of some views
// only, what MatricesFromText says of pairs.
absl::StatusOr<CalibrationSession> SessionFromText(const std::string& text, const std::string& file,
                                                   const storage::v1::CellDescription& cell);

// Fundamental matrices as a YAML file, one entry per pair of views:
//
//   - view_a: top
//     view_b: left
//     F: [[0, 0, 0.5], [0, 0, -1], [0.25, 1, 3]]
//
// x_b' F x_a = 0 for the images x_a, x_b of one point, homogeneous mask-pixel coordinates, integers
// at pixel centres. Numbers are written so that reading gives the same ones.

// `cell`: whose views the matrices are for.
std::string MatrixFileText(const storage::v1::Calibration& calibration,
                           const storage::v1::CellDescription& cell);

// A calibration that has fundamental matrices, at least one. `file`: what messages call it.
// InvalidArgument with file and line: not such a file, a view that is not there, a pair that comes
// twice.
absl::StatusOr<storage::v1::Calibration> MatricesFromText(const std::string& text,
                                                          const std::string& file,
                                                          const storage::v1::CellDescription& cell);

}  // namespace silhouette
