// Fundamental matrices as a YAML file, one entry per pair of views:
//
//   - view_a: top
//     view_b: left
//     F: [[0, 0, 0.5], [0, 0, -1], [0.25, 1, 3]]
//
// x_b' F x_a = 0 for the images x_a, x_b of one point, homogeneous mask-pixel coordinates, integers
// at pixel centres. Numbers are written so that reading gives the same ones.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

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
