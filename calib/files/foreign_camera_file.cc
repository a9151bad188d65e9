// SPDX-License-Identifier: Apache-2.0
#include "calib/files/foreign_camera_file.h"

#include <tinyxml.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/camera/equidistant_lens.h"
#include "calib/files/camera_file.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
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
