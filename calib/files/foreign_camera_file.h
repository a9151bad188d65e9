// SPDX-License-Identifier: Apache-2.0
// Camera files of other programs. Their keys tell the formats apart:
//
//   mrcal     .cameramodel (camera_file.h); the only one whose pose is kept
//   OpenCV    YAML or XML of cv::FileStorage: camera_matrix, distortion_coefficients, image_width,
//             image_height; fisheye_model too; a stereo pair's K1 and D1, or M1 and D1 (cameras "1"
//             and "2"); or the matrix's nine numbers and the coefficients, without keys
//   ROS       camera_info as YAML: distortion_model plumb_bob, rational_polynomial or equidistant;
//             K and D too
//   Kalibr    camchain: cam0, cam1, ...: camera_model pinhole, distortion_model radtan, equidistant
//             or none
//
// Of these only lenses that CameraModel holds are read: exactly, or equidistant ones to a tenth of
// a pixel (NearestToEquidistant).
#pragma once

#include <array>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "calib/camera/camera_model.h"
#include "calib/camera/lens_region.h"

namespace silhouette {

struct ForeignCamera {
  CameraModel camera;
  std::string format;    // "mrcal", "OpenCV", "ROS" or "Kalibr"
  double converted = 0;  // pixels by which the camera differs from the file's, at most
  // OpenCV's coefficients were four, taken for k1, k2, p1, p2, and nothing says that they are not
  // those of cv2.fisheye.
  bool may_be_fisheye = false;
  std::optional<LensRegion> known = std::nullopt;  // of mrcal's files
};

struct ForeignCameraOptions {
  // For files that do not say it. Must agree with those that do.
  std::optional<std::array<int, 2>> image_size = std::nullopt;
  std::string camera = {};  // which of a file's several cameras: "cam1", "2"
  // OpenCV's four coefficients are those of cv2.fisheye. InvalidArgument for formats that name the
  // lens model themselves.
  bool fisheye = false;
};

// `file`: what messages call it. InvalidArgument with file and line: none of these formats, a lens
// model that is not held, a value that is missing or of the wrong shape, no image size, several
// cameras and none chosen.
absl::StatusOr<ForeignCamera> CameraFromForeignText(const std::string& text,
                                                    const std::string& file,
                                                    const ForeignCameraOptions& options = {});

}  // namespace silhouette
