#include "tools/silhouette-calibrate/camera_files.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "calib/files/calibration_camera_file.h"
#include "calib/files/calibration_message.h"
#include "common/picture/files.h"

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
  const absl::StatusOr<std::string> text = ReadWholeFile(file);
  if (!text.ok()) return text.status();
  const absl::StatusOr<storage::v1::CameraModel> message = CameraFromText(*text, file);
  if (!message.ok()) return message.status();
  absl::StatusOr<CameraModel> camera = CameraFrom(*message);
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
    const absl::StatusOr<CameraModel> camera = ReadCameraFile(file.string());
    if (!camera.ok()) return camera.status();
    cameras.push_back({ViewOfCameraFile(file.string()), *camera});
  }
  return cameras;
}

absl::StatusOr<std::string> WriteCameraFile(const std::string& folder, const std::string& view,
                                            const CameraModel& camera) {
  if (absl::Status made = MakeFolder(folder); !made.ok()) return made;
  const std::string path = (fs::path(folder) / CameraFileName(view)).string();
  const absl::Status written = WriteWholeFile(path, CameraFileText(MessageOf(camera), view));
  if (!written.ok()) return written;
  return path;
}

}  // namespace silhouette
