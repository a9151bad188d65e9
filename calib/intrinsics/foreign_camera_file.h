// Camera files of other programs. The formats are told by their keys:
//
//   mrcal     .cameramodel (calib/files/calibration_camera_file.h); the only one whose pose is kept
//   OpenCV    YAML of cv::FileStorage: camera_matrix, distortion_coefficients, image_width, ...
//   ROS       camera_info as YAML: distortion_model plumb_bob or rational_polynomial; K and D too
//   Kalibr    camchain: cam0, cam1, ...: camera_model pinhole, distortion_model radtan or none
//
// Of these only lenses that CameraModel holds exactly are read.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "calib/camera/camera_model.h"

namespace silhouette {

struct ForeignCamera {
  CameraModel camera;
  std::string format;  // "mrcal", "OpenCV", "ROS" or "Kalibr"
};

struct ForeignCameraOptions {
  // For files that do not say it. Must agree with those that do.
  std::optional<std::array<int, 2>> image_size = std::nullopt;
  std::string camera = {};  // which of a file's several cameras, e.g. "cam1"
};

// `file`: what messages call it. InvalidArgument with file and line: none of these formats, a lens
// model that is not held, a value that is missing or of the wrong shape, no image size, several
// cameras and none chosen.
absl::StatusOr<ForeignCamera> CameraFromForeignText(const std::string& text,
                                                    const std::string& file,
                                                    const ForeignCameraOptions& options = {});

}  // namespace silhouette
