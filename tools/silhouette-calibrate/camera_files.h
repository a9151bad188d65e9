// Folders of camera models, VIEW.cameramodel.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/camera/camera_model.h"

namespace silhouette {

struct CameraFile {
  std::string view;
  CameraModel camera;
};

// The view that CameraFileName made a file's name of.
std::string ViewOfCameraFile(const std::string& path);

// NotFound: no such file; InvalidArgument with file and line: not a camera model.
absl::StatusOr<CameraModel> ReadCameraFile(const std::string& file);

// By the views' names. NotFound: no such folder, or no camera model in it; InvalidArgument with
// file and line: not a camera model.
absl::StatusOr<std::vector<CameraFile>> ReadCameraFolder(const std::string& folder);

// Makes the folder if it is not there. Returns the file's path.
absl::StatusOr<std::string> WriteCameraFile(const std::string& folder, const std::string& view,
                                            const CameraModel& camera);

}  // namespace silhouette
