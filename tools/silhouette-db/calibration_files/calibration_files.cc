// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/calibration_files/calibration_files.h"

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/camera/epipolar_angles.h"
#include "calib/files/calibration_session_file.h"
#include "calib/files/camera_file.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "db/store/store.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using storage::v1::CellDescription;

std::string ViewsOf(const CellDescription& cell) {
  return absl::StrJoin(cell.views(), ", ", [](std::string* out, const storage::v1::View& view) {
    absl::StrAppend(out, view.name());
  });
}

bool IsYaml(const std::string& path) {
  const std::string extension = fs::path(path).extension().string();
  return extension == ".yaml" || extension == ".yml";
}

// Which view an input is for, and its file.
struct ViewFile {
  int view = 0;
  std::string file;
};

absl::StatusOr<ViewFile> ViewFileOf(const std::string& input, const CellDescription& cell) {
  for (int i = 0; i < cell.views_size(); ++i) {
    const std::string& name = cell.views(i).name();
    if (input.starts_with(name + "=")) return ViewFile{i, input.substr(name.size() + 1)};
  }
  const bool of_no_view = absl::StrContains(input, '=') && !fs::exists(input);
  for (int i = 0; i < cell.views_size() && !of_no_view; ++i) {
    if (fs::path(input).filename() == CameraFileName(cell.views(i).name())) {
      return ViewFile{i, input};
    }
  }
  if (!absl::StrContains(input, '=') && !fs::exists(input)) {
    return absl::NotFoundError(absl::StrCat("the calibration '", input, "' is not there"));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("'", input, "' is not named after a view of the database, which has ",
                   ViewsOf(cell), "; say VIEW=FILE"));
}

// One file per view, in the order of the views. `folder`: where all of them should be; empty: they
// were named one by one.
absl::StatusOr<std::vector<std::string>> FilesByView(const std::vector<std::string>& inputs,
                                                     const std::string& folder,
                                                     const CellDescription& cell) {
  std::vector<std::string> files(static_cast<size_t>(cell.views_size()));
  for (const std::string& input : inputs) {
    ASSIGN_OR_RETURN(const ViewFile given, ViewFileOf(input, cell));
    std::string& file = files[static_cast<size_t>(given.view)];
    if (!file.empty()) {
      return absl::InvalidArgumentError(absl::StrCat("view '", cell.views(given.view).name(),
                                                     "' has two files, '", file, "' and '",
                                                     given.file, "'; give one"));
    }
    file = given.file;
  }
  for (int i = 0; i < cell.views_size(); ++i) {
    if (!files[static_cast<size_t>(i)].empty()) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "view '", cell.views(i).name(), "' has no camera model",
        folder.empty() ? "; give " : absl::StrCat(" in the folder '", folder, "'; add "),
        CameraFileName(cell.views(i).name()), ", too"));
  }
  return files;
}

absl::StatusOr<storage::v1::CameraModel> CameraIn(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  return StoredCameraFromText(text, file);
}

// `files`: by view.
absl::Status AddCameras(const std::vector<std::string>& files, const CellDescription& cell,
                        storage::v1::Calibration& calibration) {
  for (size_t i = 0; i < files.size(); ++i) {
    absl::StatusOr<storage::v1::CameraModel> camera = CameraIn(files[i]);
    if (!camera.ok()) {
      return absl::Status(camera.status().code(),
                          absl::StrCat("view '", cell.views(static_cast<int>(i)).name(),
                                       "': ", camera.status().message()));
    }
    *calibration.add_cameras() = *std::move(camera);
  }
  return absl::OkStatus();
}

// Of calibration.yaml, with the cameras that it names, or of a file of matrices.
absl::StatusOr<storage::v1::Calibration> ReadYaml(const std::string& file,
                                                  const CellDescription& cell) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  if (!IsSessionFile(text)) return MatricesFromText(text, file, cell);
  ASSIGN_OR_RETURN(CalibrationSession session, SessionFromText(text, file, cell));
  if (session.camera_files.empty()) return std::move(session.calibration);
  // The cameras are the calibration; the pairs follow from them.
  session.calibration.clear_fundamental_matrices();
  for (std::string& camera : session.camera_files) {
    camera = (fs::path(file).parent_path() / camera).string();
  }
  RETURN_IF_ERROR(AddCameras(session.camera_files, cell, session.calibration));
  return std::move(session.calibration);
}

absl::StatusOr<storage::v1::Calibration> ReadCameras(const std::vector<std::string>& inputs,
                                                     const CellDescription& cell) {
  std::vector<std::string> named = inputs;
  std::string folder;
  if (inputs.size() == 1 && fs::is_directory(inputs[0])) {
    const std::string session = (fs::path(inputs[0]) / kSessionFileName).string();
    if (fs::exists(session)) return ReadYaml(session, cell);
    folder = inputs[0];
    named.clear();
    for (const storage::v1::View& view : cell.views()) {
      const fs::path file = fs::path(folder) / CameraFileName(view.name());
      if (fs::exists(file)) named.push_back(file.string());
    }
  }
  ASSIGN_OR_RETURN(const std::vector<std::string> files, FilesByView(named, folder, cell));
  storage::v1::Calibration calibration;
  RETURN_IF_ERROR(AddCameras(files, cell, calibration));
  return calibration;
}

std::string PairText(const CellDescription& cell, int a, int b) {
  return absl::StrCat("views '", cell.views(a).name(), "' and '", cell.views(b).name(), "'");
}

PixelSize SizeOf(const storage::v1::View& view) {
  return {.width = view.mask_width(), .height = view.mask_height()};
}

}  // namespace

absl::StatusOr<storage::v1::Calibration> ReadCalibration(const std::vector<std::string>& inputs,
                                                         const CellDescription& cell) {
  absl::StatusOr<storage::v1::Calibration> calibration;
  if (inputs.size() == 1 && IsYaml(inputs[0])) {
    calibration = ReadYaml(inputs[0], cell);
  } else {
    calibration = ReadCameras(inputs, cell);
  }
  if (!calibration.ok()) return calibration;
  RETURN_IF_ERROR(CheckCalibration(*calibration, cell));
  return calibration;
}

absl::Status CheckLines(const Calibration& calibration, const CellDescription& cell) {
  int a = 0;
  int b = 0;
  try {
    for (a = 0; a < static_cast<int>(calibration.cameras.size()); ++a) {
      for (b = 0; b < a; ++b) {
        // One pixel is enough to see whether there are lines.
        AnglesBetween(calibration.cameras[static_cast<size_t>(b)].ScaledTo(1, 1),
                      calibration.cameras[static_cast<size_t>(a)].ScaledTo(1, 1));
      }
    }
    for (const FundamentalMatrix& matrix : calibration.fundamental_matrices) {
      a = matrix.view_b;
      b = matrix.view_a;
      AnglesBetween(matrix.f, SizeOf(cell.views(b)), SizeOf(cell.views(a)));
    }
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat(PairText(cell, b, a), ": ", error.what()));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> WriteCalibration(
    const storage::v1::Calibration& calibration, const CellDescription& cell,
    const std::string& out) {
  std::vector<std::pair<std::string, std::string>> files;  // path, text
  if (calibration.cameras().empty()) {
    files.emplace_back(out, calibration.has_record() ? SessionFileText({calibration, {}}, cell)
                                                     : MatrixFileText(calibration, cell));
  } else {
    RETURN_IF_ERROR(MakeFolder(out));
  }
  for (int i = 0; i < calibration.cameras_size(); ++i) {
    const std::string& view = cell.views(i).name();
    files.emplace_back((fs::path(out) / CameraFileName(view)).string(),
                       CameraFileText(calibration.cameras(i), view));
  }
  if (calibration.has_record() && !calibration.cameras().empty()) {
    CalibrationSession session{.calibration = calibration, .camera_files = {}};
    for (const auto& file : files) {
      session.camera_files.push_back(fs::path(file.first).filename().string());
    }
    files.emplace_back((fs::path(out) / kSessionFileName).string(), SessionFileText(session, cell));
  }
  std::vector<std::string> paths;
  for (const auto& [path, text] : files) {
    if (!fs::exists(path)) continue;
    return absl::AlreadyExistsError(absl::StrCat("'", path, "' is there already; give a new name"));
  }
  for (const auto& [path, text] : files) {
    RETURN_IF_ERROR(WriteWholeFile(path, text));
    paths.push_back(path);
  }
  return paths;
}

}  // namespace silhouette
