// Camera models as text files, `.cameramodel`: the format of mrcal, whose tools can read what is
// written here and write what is read here. One camera a file, a Python dictionary of
//
//   lensmodel    'LENSMODEL_PINHOLE', '..._OPENCV4', '..._OPENCV5' or '..._OPENCV8'
//   intrinsics   fx, fy, cx, cy, then the distortion: k1 k2 p1 p2 [k3 [k4 k5 k6]]
//   extrinsics   from the world to the camera: rotation vector (radians), translation (metres)
//   imagersize   width, height
//
// and others, which are skipped. Numbers are written so that reading gives the same ones.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

inline constexpr char kCameraFileExtension[] = ".cameramodel";

// The name of a view's file: the view's name and the extension. What cannot be in a file's name is
// replaced by % and its code.
std::string CameraFileName(const std::string& view);

std::string CameraFileText(const storage::v1::CameraModel& camera, const std::string& view);

// The same for any lens model of mrcal's, by its name and with the parameters it has.
struct CameraFileFields {
  std::string lens_model;
  std::vector<double> intrinsics;
  std::vector<double> rotation;  // vector, radians
  std::vector<double> translation;
  int image_width = 0;
  int image_height = 0;
};
std::string CameraFileText(const CameraFileFields& camera, const std::string& view);

// `file`: what messages call it. InvalidArgument with file and line: not such a file, a key that is
// missing, another lens model, too few or too many numbers.
absl::StatusOr<storage::v1::CameraModel> CameraFromText(const std::string& text,
                                                        const std::string& file);

}  // namespace silhouette
