#include "calib/files/calibration_camera_file.h"

#include <cctype>
#include <map>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/yaml/strict_yaml.h"

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
  const std::vector<double> extrinsics = map.Required("extrinsics").Values<double>(6);
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

std::string CameraFileText(const CameraFileFields& camera, const std::string& view) {
  const auto numbers = [](const std::vector<double>& values) {
    return absl::StrJoin(values, ", ", [](std::string* out, double value) {
      absl::StrAppendFormat(out, "%.17g", value);
    });
  };
  return absl::StrCat(
      "# Camera model of the view ", CameraFileName(view), "\n{\n    'lensmodel':  '",
      camera.lens_model,
      "',\n\n    # fx, fy, cx, cy and the distortion; pixels\n    'intrinsics': [ ",
      numbers(camera.intrinsics),
      " ],\n\n    # rotation vector and translation from the world to the camera; radians, metres\n"
      "    'extrinsics': [ ",
      numbers(camera.rotation), ", ", numbers(camera.translation), " ],\n\n    'imagersize': [ ",
      camera.image_width, ", ", camera.image_height, " ]\n}\n");
}

std::string CameraFileText(const storage::v1::CameraModel& camera, const std::string& view) {
  CameraFileFields fields{.lens_model = NameOfLensModel(camera.distortion_size()),
                          .intrinsics = {camera.fx(), camera.fy(), camera.cx(), camera.cy()},
                          .rotation = {camera.rotation().begin(), camera.rotation().end()},
                          .translation = {camera.translation().begin(), camera.translation().end()},
                          .image_width = camera.image_width(),
                          .image_height = camera.image_height()};
  fields.intrinsics.insert(fields.intrinsics.end(), camera.distortion().begin(),
                           camera.distortion().end());
  return CameraFileText(fields, view);
}

absl::StatusOr<storage::v1::CameraModel> CameraFromText(const std::string& text,
                                                        const std::string& file) {
  try {
    return ReadCamera(YamlNode::FromText(YamlOf(text), file));
  } catch (const YamlError& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

}  // namespace silhouette
