// SPDX-License-Identifier: Apache-2.0
#include "calib/files/camera_file.h"

#include <cctype>
#include <map>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/files/calibration_message.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Lens models by name, with the number of their distortion parameters.
const std::map<std::string, int>& LensModels() {
  static const std::map<std::string, int> models = {{"LENSMODEL_PINHOLE", 0},
                                                    {"LENSMODEL_OPENCV4", 4},
                                                    {"LENSMODEL_OPENCV5", 5},
                                                    {"LENSMODEL_OPENCV8", 8}};
  return models;
}

std::string NameOfLensModel(int parameters) {
  for (const auto& [name, count] : LensModels()) {
    if (count == parameters) return name;
  }
  return "";
}

// A Python dictionary as YAML's flow style: tuples become lists, b'...' becomes '...'.
std::string YamlOf(const std::string& python) {
  std::string yaml;
  char quote = 0;
  bool comment = false;
  for (size_t i = 0; i < python.size(); ++i) {
    char c = python[i];
    if (comment) {
      comment = c != '\n';
    } else if (quote != 0) {
      if (c == quote) quote = 0;
    } else if (c == '#') {
      comment = true;
    } else if (c == '\'' || c == '"') {
      quote = c;
    } else if (c == 'b' && i + 1 < python.size() &&
               (python[i + 1] == '\'' || python[i + 1] == '"')) {
      continue;
    } else if (c == '(') {
      c = '[';
    } else if (c == ')') {
      c = ']';
    }
    yaml += c;
  }
  return yaml;
}

// The dictionary of a file. Throws YamlError, which says where the file seems to be cut off.
YamlNode DictionaryOf(const std::string& text, const std::string& file) {
  try {
    return YamlNode::FromText(YamlOf(text), file);
  } catch (const YamlError& error) {
    const size_t last = text.find_last_not_of(" \t\r\n");
    if (last != std::string::npos && text[last] == '}') throw;
    throw YamlError(absl::StrCat(error.what(), "; the file is cut off, copy or write it again"));
  }
}

storage::v1::CameraModel ReadCamera(const YamlNode& root) {
  YamlMap map(root);
  const YamlNode lens = map.Required("lensmodel");
  const auto model = LensModels().find(lens.As<std::string>());
  if (model == LensModels().end()) {
    lens.Fail(absl::StrCat("'", lens.As<std::string>(),
                           "' is not supported; use LENSMODEL_PINHOLE, LENSMODEL_OPENCV4, "
                           "LENSMODEL_OPENCV5 or LENSMODEL_OPENCV8 (mrcal-convert-lensmodel "
                           "makes one from another)"));
  }
  const auto parameters = static_cast<size_t>(model->second);
  const std::vector<double> intrinsics = map.Required("intrinsics").Values<double>(4 + parameters);
  const std::optional<YamlNode> pose = map.Optional("rt_cam_ref");
  const std::vector<double> extrinsics =
      (pose ? *pose : map.Required("extrinsics")).Values<double>(6);
  const std::vector<int> size = map.Required("imagersize").Values<int>(2);
  storage::v1::CameraModel camera;
  camera.set_image_width(size[0]);
  camera.set_image_height(size[1]);
  camera.set_fx(intrinsics[0]);
  camera.set_fy(intrinsics[1]);
  camera.set_cx(intrinsics[2]);
  camera.set_cy(intrinsics[3]);
  camera.mutable_distortion()->Assign(intrinsics.begin() + 4, intrinsics.end());
  camera.mutable_rotation()->Assign(extrinsics.begin(), extrinsics.begin() + 3);
  camera.mutable_translation()->Assign(extrinsics.begin() + 3, extrinsics.end());
  return camera;
}

std::optional<LensRegion> ReadRegion(const YamlNode& root) {
  YamlMap map(root);
  const auto contour = map.Optional("valid_intrinsics_region");
  if (!contour) return std::nullopt;
  LensRegion region;
  for (const YamlNode& point : contour->Items()) {
    const std::vector<double> xy = point.Values<double>(2);
    region.contour.emplace_back(xy[0], xy[1]);
  }
  const auto& line = region.contour;
  if (!line.empty() && (line.size() < 4 || (line.front() - line.back()).norm() > 1e-3)) {
    contour->Fail(
        "is no closed line; give four points [x, y] or more, the last one equal to the first, or "
        "leave it out");
  }
  if (const auto sigma = map.Optional("valid_intrinsics_sigma")) region.sigma = sigma->AsPositive();
  return region;
}

void Exactly(std::string* out, double value) { absl::StrAppendFormat(out, "%.17g", value); }

std::string RegionText(const std::optional<LensRegion>& region) {
  if (!region) return "";
  std::string text =
      ",\n\n    # where the lens is known, and to how many pixels (standard deviation)\n"
      "    'valid_intrinsics_region': [";
  for (const Eigen::Vector2d& point : region->contour) {
    absl::StrAppendFormat(&text, "\n    [ %.17g, %.17g ],", point.x(), point.y());
  }
  absl::StrAppend(&text, " ]");
  if (region->sigma) {
    absl::StrAppendFormat(&text, ",\n    'valid_intrinsics_sigma': %.17g", *region->sigma);
  }
  return text;
}

template <typename Three>
std::string FileText(const std::string& lens_model, const std::vector<double>& intrinsics,
                     int image_width, int image_height, const Three& rotation,
                     const Three& translation, const std::string& view,
                     const std::optional<LensRegion>& known) {
  const auto numbers = [](const auto& values) { return absl::StrJoin(values, ", ", Exactly); };
  return absl::StrCat(
      "# Camera model of the view ", CameraFileName(view), "\n{\n    'lensmodel':  '", lens_model,
      "',\n\n    # fx, fy, cx, cy and the distortion; pixels\n    'intrinsics': [ ",
      numbers(intrinsics),
      " ],\n\n    # rotation vector and translation from the world to the camera; radians, metres\n"
      "    'extrinsics': [ ",
      numbers(rotation), ", ", numbers(translation), " ],\n\n    'imagersize': [ ", image_width,
      ", ", image_height, " ]", RegionText(known), "\n}\n");
}

}  // namespace

std::string CameraFileName(const std::string& view) {
  std::string name;
  for (const char c : view) {
    const bool plain = c != '/' && c != '%' && std::iscntrl(static_cast<unsigned char>(c)) == 0;
    if (plain) {
      name += c;
    } else {
      absl::StrAppendFormat(&name, "%%%02x", static_cast<unsigned char>(c));
    }
  }
  return name + kCameraFileExtension;
}

namespace {

std::string StoredFileText(const storage::v1::CameraModel& camera, const std::string& view,
                           const std::optional<LensRegion>& known) {
  std::vector<double> intrinsics = {camera.fx(), camera.fy(), camera.cx(), camera.cy()};
  intrinsics.insert(intrinsics.end(), camera.distortion().begin(), camera.distortion().end());
  return FileText(NameOfLensModel(camera.distortion_size()), intrinsics, camera.image_width(),
                  camera.image_height(), camera.rotation(), camera.translation(), view, known);
}

}  // namespace

std::string CameraFileText(const CameraModel& camera, const std::string& view,
                           const std::optional<LensRegion>& known) {
  return StoredFileText(MessageOf(camera), view, known);
}

std::string CameraFileText(const storage::v1::CameraModel& camera, const std::string& view) {
  return StoredFileText(camera, view, std::nullopt);
}

std::string CameraFileText(const std::string& lens_model, const std::vector<double>& intrinsics,
                           int image_width, int image_height,
                           const Eigen::Isometry3d& camera_from_world, const std::string& view,
                           const std::optional<LensRegion>& known) {
  return FileText(lens_model, intrinsics, image_width, image_height,
                  RotationVectorOf(camera_from_world),
                  Eigen::Vector3d(camera_from_world.translation()), view, known);
}

absl::StatusOr<storage::v1::CameraModel> StoredCameraFromText(const std::string& text,
                                                              const std::string& file) {
  try {
    return ReadCamera(DictionaryOf(text, file));
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

absl::StatusOr<std::optional<LensRegion>> LensRegionFromText(const std::string& text,
                                                             const std::string& file) {
  try {
    return ReadRegion(DictionaryOf(text, file));
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

absl::StatusOr<CameraModel> CameraFromText(const std::string& text, const std::string& file) {
  ASSIGN_OR_RETURN(const storage::v1::CameraModel stored, StoredCameraFromText(text, file));
  absl::StatusOr<CameraModel> camera = CameraFrom(stored);
  if (camera.ok()) return camera;
  return InvalidArgument(file, ": ", camera.status().message());
}

}  // namespace silhouette
