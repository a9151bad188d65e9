// SPDX-License-Identifier: Apache-2.0
#include "calib/files/camera_file.h"

#include <tinyxml.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <stdexcept>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/camera/equidistant_lens.h"
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
    return ReadCamera(YamlNode::FromText(YamlOf(text), file));
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

absl::StatusOr<std::optional<LensRegion>> LensRegionFromText(const std::string& text,
                                                             const std::string& file) {
  try {
    return ReadRegion(YamlNode::FromText(YamlOf(text), file));
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

namespace {

constexpr char kOwnModel[] = "it names its lens model itself; leave --fisheye out";

// Pixels by which a lens that is converted may be off: little beside what calibrations leave.
constexpr double kMostFisheyeError = 0.1;

// cv::FileStorage begins its files with "%YAML:1.0", which is no YAML; the line stays, for the
// numbers in messages.
std::string AsYaml(std::string text) {
  if (text.starts_with("%YAML:")) text[0] = '#';
  return text;
}

// A camera matrix of bare numbers, row by row, and the distortion after it, as YAML; empty if the
// text is no such.
std::string YamlOfNumbers(const std::string& text) {
  constexpr std::ptrdiff_t kMatrix = 9;
  const std::vector<std::string> values =
      absl::StrSplit(text, absl::ByAnyChar(" \t\r\n,;[]"), absl::SkipEmpty());
  const bool numbers = std::ranges::all_of(values, [](const std::string& value) {
    double number = 0;
    return absl::SimpleAtod(value, &number);
  });
  if (!numbers || std::ssize(values) < kMatrix) return "";
  const auto distortion = values.begin() + kMatrix;
  return absl::StrCat("camera_matrix: [", absl::StrJoin(values.begin(), distortion, ", "),
                      "]\ndistortion_coefficients: [",
                      absl::StrJoin(distortion, values.end(), ", "), "]\n");
}

// cv::FileStorage's XML as YAML: matrices, numbers and texts of the first level. OpenCV's own
// reader leaves its memory when the XML is damaged.
std::string YamlOfXml(const std::string& xml) {
  TiXmlDocument document;
  document.Parse(xml.c_str());
  if (document.Error() || document.RootElement() == nullptr) {
    throw std::invalid_argument(
        absl::StrCat("the XML of OpenCV cannot be read: ", document.ErrorDesc()));
  }
  std::string yaml;
  for (const TiXmlElement* node = document.RootElement()->FirstChildElement(); node != nullptr;
       node = node->NextSiblingElement()) {
    const TiXmlElement* const data = node->FirstChildElement("data");
    const char* const text = (data != nullptr ? data : node)->GetText();
    if (text == nullptr) continue;
    const std::vector<std::string> values =
        absl::StrSplit(text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty());
    const std::string joined = absl::StrJoin(values, ", ");
    double number = 0;
    const bool bare = data == nullptr && absl::SimpleAtod(joined, &number);
    absl::StrAppend(&yaml, node->ValueStr(), ": ",
                    bare              ? joined
                    : data != nullptr ? absl::StrCat("[", joined, "]")
                                      : YamlQuoted(joined),
                    "\n");
  }
  return yaml;
}

// `number`: what each key ends with, of a camera of a stereo pair.
std::optional<YamlNode> AnyOf(YamlMap& map, const std::vector<std::string>& keys,
                              const std::string& number = "") {
  for (const std::string& key : keys) {
    if (auto node = map.Optional(key + number)) return node;
  }
  return std::nullopt;
}

// Rows or columns of a matrix: OpenCV has lenses of 14 coefficients.
constexpr int kMostEntries = 14;

// The values of a matrix: a list, a list of rows, or rows, cols and data.
std::vector<double> MatrixOf(const YamlNode& node) {
  if (node.IsMap()) {
    YamlMap map(node);
    const int rows = map.Get<int>("rows");
    const int columns = map.Get<int>("cols");
    const YamlNode data = map.Required("data");
    if (std::clamp(rows, 0, kMostEntries) != rows ||
        std::clamp(columns, 0, kMostEntries) != columns) {
      node.Fail(absl::StrCat("a matrix of ", rows, " x ", columns, " values does not belong here"));
    }
    return data.Values<double>(static_cast<size_t>(rows * columns));
  }
  std::vector<double> values;
  for (const YamlNode& item : node.Items()) {
    if (item.IsSequence()) {
      for (const double value : item.Values<double>()) values.push_back(value);
    } else {
      values.push_back(item.As<double>());
    }
  }
  return values;
}

void SetMatrix(const YamlNode& node, CameraIntrinsics& intrinsics) {
  const std::vector<double> k = MatrixOf(node);
  if (k.size() != 9) node.Fail(absl::StrCat("9 values are expected, not ", k.size()));
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
    node.Fail("only fx, fy, cx and cy may differ from the unit matrix's values (no skew)");
  }
  intrinsics.fx = k[0];
  intrinsics.fy = k[4];
  intrinsics.cx = k[2];
  intrinsics.cy = k[5];
}

void SetDistortion(const YamlNode& node, CameraIntrinsics& intrinsics) {
  const std::vector<double> d = MatrixOf(node);
  for (const size_t count : {0, 4, 5, 8, 12, 14}) {
    if (d.size() != count) continue;
    const size_t held = std::min(count, intrinsics.distortion.size());
    if (std::any_of(d.begin() + static_cast<std::ptrdiff_t>(held), d.end(),
                    [](double k) { return k != 0; })) {
      node.Fail("thin-prism and tilt terms are not held; calibrate with 8 terms or fewer");
    }
    std::copy_n(d.begin(), held, intrinsics.distortion.begin());
    return;
  }
  node.Fail(absl::StrCat("0, 4, 5, 8, 12 or 14 values are expected, not ", d.size()));
}

// An equidistant lens by its four coefficients.
ForeignCamera FromEquidistant(const YamlNode& node, const CameraIntrinsics& pinhole,
                              const std::string& format) {
  const std::vector<double> k = MatrixOf(node);
  if (k.size() != 4) {
    node.Fail(absl::StrCat("an equidistant lens has 4 coefficients, not ", k.size()));
  }
  try {
    const EquidistantFit fit = NearestToEquidistant(pinhole, {k[0], k[1], k[2], k[3]});
    if (fit.worst <= kMostFisheyeError) return {CameraModel(fit.intrinsics), format, fit.worst};
    node.Fail(
        absl::StrFormat("the nearest lens of OpenCV is off by %.2g pixels, at most %.2g are "
                        "accepted; crop the images, or calibrate with LENSMODEL_OPENCV8",
                        fit.worst, kMostFisheyeError));
  } catch (const std::invalid_argument& error) {
    node.Fail(error.what());
  }
}

void SetSize(const YamlNode& place, std::optional<std::array<int, 2>> stated,
             const ForeignCameraOptions& options, CameraIntrinsics& intrinsics) {
  if (!stated && !options.image_size) {
    place.Fail("the file does not say the images' size; give it (--image-size)");
  }
  const std::array<int, 2> size = stated ? *stated : *options.image_size;
  if (options.image_size && *options.image_size != size) {
    place.Fail(absl::StrCat("the camera is for images of ", size[0], "x", size[1],
                            " pixels, not of ", (*options.image_size)[0], "x",
                            (*options.image_size)[1]));
  }
  intrinsics.width = size[0];
  intrinsics.height = size[1];
}

std::optional<YamlNode> CameraMatrixIn(YamlMap& map, const std::string& number = "") {
  if (number.empty()) {
    return AnyOf(map,
                 {"camera_matrix", "cameraMatrix", "camera_Matrix", "Camera_Matrix", "K", "k"});
  }
  const auto matrix = AnyOf(map, {"cameraMatrix", "K", "M"}, number);
  return matrix && !matrix->IsScalar() ? matrix : std::nullopt;
}

// OpenCV and ROS: nearly the same keys. `number` as of AnyOf.
ForeignCamera FromMatrix(YamlMap& map, const YamlNode& matrix, const std::string& number,
                         const ForeignCameraOptions& options) {
  CameraIntrinsics intrinsics;
  std::string format = "OpenCV";
  bool equidistant = options.fisheye;
  bool stated = options.fisheye;
  SetMatrix(matrix, intrinsics);
  if (const auto model = map.Optional("distortion_model")) {
    format = "ROS";
    stated = true;
    if (options.fisheye) model->Fail(kOwnModel);
    const auto name = model->As<std::string>();
    equidistant = name == "equidistant" || name == "fisheye";
    if (!equidistant && name != "plumb_bob" && name != "rational_polynomial" && !name.empty()) {
      model->Fail(absl::StrCat("the distortion model '", name,
                               "' is not held; use plumb_bob, rational_polynomial or equidistant"));
    }
  }
  if (const auto fisheye = map.Optional("fisheye_model")) {
    const auto value = fisheye->As<std::string>();
    stated = true;
    equidistant = equidistant || (value != "0" && value != "false");
  }
  const auto distortion = AnyOf(map,
                                {"distortion_coefficients", "Distortion_Coefficients", "distCoeffs",
                                 "dist_coeffs", "dist_coeff", "D", "d"},
                                number);
  if (!distortion) map.Required("distortion_coefficients" + number);
  std::optional<std::array<int, 2>> size;
  const auto width = AnyOf(map, {"image_width", "image_Width", "width"});
  const auto height = AnyOf(map, {"image_height", "image_Height", "height"});
  if (width && height) size = {width->As<int>(), height->As<int>()};
  if (const auto both = AnyOf(map, {"image_size", "imageSize"})) {
    const std::vector<int> values = both->Values<int>(2);
    size = {values[0], values[1]};
  }
  SetSize(map.node(), size, options, intrinsics);
  if (equidistant) return FromEquidistant(*distortion, intrinsics, format);
  SetDistortion(*distortion, intrinsics);
  return {.camera = CameraModel(intrinsics),
          .format = format,
          .may_be_fisheye = !stated && MatrixOf(*distortion).size() == 4};
}

ForeignCamera FromKalibr(const YamlNode& node, const ForeignCameraOptions& options) {
  YamlMap map(node);
  if (options.fisheye) node.Fail(kOwnModel);
  const YamlNode model = map.Required("camera_model");
  if (model.As<std::string>() != "pinhole") {
    model.Fail(absl::StrCat("the camera model '", model.As<std::string>(),
                            "' is not held; calibrate with pinhole and radtan or equi"));
  }
  const YamlNode distortion = map.Required("distortion_model");
  const auto name = distortion.As<std::string>();
  const bool radtan = name == "radtan" || name == "radial-tangential";  // Kalibr's and EuRoC's
  if (!radtan && name != "none" && name != "equidistant" && name != "equi") {
    distortion.Fail(absl::StrCat("the distortion model '", name,
                                 "' is not held; calibrate with radtan or equi"));
  }
  const std::vector<double> k = map.Required("intrinsics").Values<double>(4);
  CameraIntrinsics intrinsics{.fx = k[0], .fy = k[1], .cx = k[2], .cy = k[3]};
  const std::vector<int> size = map.Required("resolution").Values<int>(2);
  SetSize(node, std::array<int, 2>{size[0], size[1]}, options, intrinsics);
  if (name == "none") return {CameraModel(intrinsics), "Kalibr"};
  const auto listed = AnyOf(map, {"distortion_coeffs", "distortion_coefficients"});
  const YamlNode coefficients = listed ? *listed : map.Required("distortion_coeffs");
  coefficients.Items(4);
  if (!radtan) return FromEquidistant(coefficients, intrinsics, "Kalibr");
  SetDistortion(coefficients, intrinsics);
  return {CameraModel(intrinsics), "Kalibr"};
}

ForeignCamera FromYaml(const YamlNode& root, const ForeignCameraOptions& options) {
  YamlMap map(root);
  if (const auto matrix = CameraMatrixIn(map)) return FromMatrix(map, *matrix, "", options);
  if (map.Optional("camera_model")) return FromKalibr(root, options);
  std::vector<std::string> cameras;
  for (const std::string& key : map.Keys()) {
    const YamlNode node = map.Required(key);
    if (!node.IsMap()) continue;
    YamlMap inner(node);
    if (inner.Optional("camera_model")) cameras.push_back(key);
  }
  for (const char* const number : {"1", "2"}) {
    if (CameraMatrixIn(map, number)) cameras.emplace_back(number);
  }
  if (cameras.empty()) {
    root.Fail(
        "no camera is found in it; a .cameramodel, OpenCV's or ROS's camera_matrix or Kalibr's "
        "camchain is expected");
  }
  std::string chosen = options.camera;
  if (chosen.empty() && cameras.size() == 1) chosen = cameras[0];
  if (std::ranges::find(cameras, chosen) == cameras.end()) {
    root.Fail(absl::StrCat(chosen.empty() ? "say which camera is meant"
                                          : absl::StrCat("there is no camera '", chosen, "'"),
                           "; there are ", ListOfWords(cameras), " (--camera)"));
  }
  if (const auto matrix = CameraMatrixIn(map, chosen)) {
    return FromMatrix(map, *matrix, chosen, options);
  }
  return FromKalibr(map.Required(chosen), options);
}

}  // namespace

absl::StatusOr<ForeignCamera> CameraFromForeignText(const std::string& text,
                                                    const std::string& file,
                                                    const ForeignCameraOptions& options) {
  try {
    if (text.find("'lensmodel'") != std::string::npos ||
        text.find("\"lensmodel\"") != std::string::npos || file.ends_with(kCameraFileExtension)) {
      if (options.fisheye) return InvalidArgument(file, ": ", kOwnModel);
      ASSIGN_OR_RETURN(const CameraModel camera, CameraFromText(text, file));
      CameraIntrinsics checked = camera.intrinsics();
      SetSize(YamlNode::FromText("{}", file), std::array<int, 2>{checked.width, checked.height},
              options, checked);
      ASSIGN_OR_RETURN(const auto known, LensRegionFromText(text, file));
      return ForeignCamera{.camera = camera, .format = "mrcal", .known = known};
    }
    std::string yaml = YamlOfNumbers(text);
    if (yaml.empty()) yaml = text.starts_with("<?xml") ? YamlOfXml(text) : AsYaml(text);
    return FromYaml(YamlNode::FromText(yaml, file), options);
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  } catch (const std::invalid_argument& error) {
    return InvalidArgument(file, ": ", error.what());
  }
}

}  // namespace silhouette
