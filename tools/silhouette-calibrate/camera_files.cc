#include "tools/silhouette-calibrate/camera_files.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "calib/files/calibration_camera_file.h"
#include "calib/files/calibration_message.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

}  // namespace

std::string ViewOfCameraFile(const std::string& path) {
  const std::string name = fs::path(path).stem().string();
  std::string view;
  for (size_t i = 0; i < name.size(); ++i) {
    int code = 0;
    if (name[i] == '%' && i + 2 < name.size() &&
        absl::SimpleHexAtoi(name.substr(i + 1, 2), &code)) {
      view += static_cast<char>(code);
      i += 2;
    } else {
      view += name[i];
    }
  }
  return view;
}

absl::StatusOr<CameraModel> ReadCameraFile(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  ASSIGN_OR_RETURN(const storage::v1::CameraModel message, CameraFromText(text, file));
  absl::StatusOr<CameraModel> camera = CameraFrom(message);
  if (camera.ok()) return camera;
  return absl::Status(camera.status().code(), absl::StrCat(file, ": ", camera.status().message()));
}

absl::StatusOr<std::vector<CameraFile>> ReadCameraFolder(const std::string& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == kCameraFileExtension) files.push_back(entry.path());
  }
  if (error) {
    return absl::NotFoundError(
        absl::StrCat("the folder '", folder, "' cannot be read: ", error.message()));
  }
  if (files.empty()) {
    return absl::NotFoundError(absl::StrCat("there is no camera model (VIEW", kCameraFileExtension,
                                            ") in '", folder, "'"));
  }
  std::sort(files.begin(), files.end());
  std::vector<CameraFile> cameras;
  for (const fs::path& file : files) {
    ASSIGN_OR_RETURN(const CameraModel camera, ReadCameraFile(file.string()));
    cameras.push_back({ViewOfCameraFile(file.string()), camera});
  }
  return cameras;
}

absl::StatusOr<std::string> WriteCameraFile(const std::string& folder, const std::string& view,
                                            const CameraModel& camera) {
  RETURN_IF_ERROR(MakeFolder(folder));
  const std::string path = (fs::path(folder) / CameraFileName(view)).string();
  RETURN_IF_ERROR(WriteWholeFile(path, CameraFileText(MessageOf(camera), view)));
  return path;
}

}  // namespace silhouette
