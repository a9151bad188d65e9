// SPDX-License-Identifier: Apache-2.0
// Camera models as text files, `.cameramodel`: the format of mrcal, whose tools can read what is
// written here and write what is read here. One camera a file, a Python dictionary of
//
//   lensmodel    'LENSMODEL_PINHOLE', '..._OPENCV4', '..._OPENCV5' or '..._OPENCV8'
//   intrinsics   fx, fy, cx, cy, then the distortion: k1 k2 p1 p2 [k3 [k4 k5 k6]]
//   extrinsics   from the world to the camera: rotation vector (radians), translation (metres);
//                newer files of mrcal name it rt_cam_ref
//   imagersize   width, height
//   valid_intrinsics_region   optional; where the lens is known: points [x, y] of a closed line, in
//                pixels, the last one equal to the first; [] for nowhere
//   valid_intrinsics_sigma    LensRegion::sigma, if this project's programs found the region
//
// and others, which are skipped. Numbers are written so that reading gives the same ones.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/camera_model.h"
#include "calib/camera/lens_region.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

inline constexpr char kCameraFileExtension[] = ".cameramodel";

// The name of a view's file: the view's name and the extension. What cannot be in a file's name is
// replaced by % and its code.
std::string CameraFileName(const std::string& view);

// The pose to within a rounding error, all else to the bit.
std::string CameraFileText(const CameraModel& camera, const std::string& view,
                           const std::optional<LensRegion>& known = std::nullopt);
// As it is stored, to the bit.
std::string CameraFileText(const storage::v1::CameraModel& camera, const std::string& view);
// Any lens model of mrcal's, by its name and with the parameters it has. Those that CameraModel
// holds are written so that all of this project's programs read them, others as mrcal does.
std::string CameraFileText(const std::string& lens_model, const std::vector<double>& intrinsics,
                           int image_width, int image_height,
                           const Eigen::Isometry3d& camera_from_world, const std::string& view,
                           const std::optional<LensRegion>& known = std::nullopt);

// `file`: what messages call it. InvalidArgument with file and line: not such a file, a key that is
// missing, another lens model, too few or too many numbers, values that are no camera.
absl::StatusOr<CameraModel> CameraFromText(const std::string& text, const std::string& file);
// As it is to be stored, to the bit; the values may be no camera.
absl::StatusOr<storage::v1::CameraModel> StoredCameraFromText(const std::string& text,
                                                              const std::string& file);

// Where the lens is known; nothing if the file does not state it. InvalidArgument with file and
// line: not such a file, or no closed line.
absl::StatusOr<std::optional<LensRegion>> LensRegionFromText(const std::string& text,
                                                             const std::string& file);

}  // namespace silhouette
