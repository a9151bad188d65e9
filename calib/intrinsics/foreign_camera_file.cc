#include "calib/intrinsics/foreign_camera_file.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/files/calibration_camera_file.h"
#include "calib/files/calibration_message.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// cv::FileStorage begins its files with "%YAML:1.0", which is no YAML; the line stays, for the
// numbers in messages.
std::string AsYaml(std::string text) {
  if (text.starts_with("%YAML:")) text[0] = '#';
  return text;
}

std::optional<YamlNode> AnyOf(YamlMap& map, const std::vector<std::string>& keys) {
  for (const std::string& key : keys) {
    if (auto node = map.Optional(key)) return node;
  }
  return std::nullopt;
}

// The values of a matrix: a list, a list of rows, or rows, cols and data.
std::vector<double> MatrixOf(const YamlNode& node) {
  if (node.IsMap()) {
    YamlMap map(node);
    const int values = map.Get<int>("rows") * map.Get<int>("cols");
    return map.Required("data").Values<double>(static_cast<size_t>(std::max(values, 0)));
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

void SetSize(const YamlNode& place, std::optional<std::array<int, 2>> stated,
             const ForeignCameraOptions& options, CameraIntrinsics& intrinsics) {
  if (!stated && !options.image_size) {
    place.Fail("the file does not say the images' size; give it");
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

// OpenCV and ROS: nearly the same keys.
ForeignCamera FromMatrix(YamlMap& map, const YamlNode& matrix,
                         const ForeignCameraOptions& options) {
  CameraIntrinsics intrinsics;
  std::string format = "OpenCV";
  SetMatrix(matrix, intrinsics);
  if (const auto model = map.Optional("distortion_model")) {
    format = "ROS";
    const auto name = model->As<std::string>();
    if (name != "plumb_bob" && name != "rational_polynomial" && !name.empty()) {
      model->Fail(absl::StrCat("the distortion model '", name,
                               "' is not held; use plumb_bob or rational_polynomial"));
    }
  }
  if (const auto fisheye = map.Optional("fisheye_model");
      fisheye && fisheye->As<std::string>() != "0" && fisheye->As<std::string>() != "false") {
    fisheye->Fail("fisheye lenses are not held");
  }
  const auto distortion =
      AnyOf(map, {"distortion_coefficients", "distCoeffs", "dist_coeffs", "dist_coeff", "D", "d"});
  if (!distortion) map.Required("distortion_coefficients");
  SetDistortion(*distortion, intrinsics);
  std::optional<std::array<int, 2>> size;
  const auto width = AnyOf(map, {"image_width", "image_Width", "width"});
  const auto height = AnyOf(map, {"image_height", "image_Height", "height"});
  if (width && height) size = {width->As<int>(), height->As<int>()};
  if (const auto both = AnyOf(map, {"image_size", "imageSize"})) {
    const std::vector<int> values = both->Values<int>(2);
    size = {values[0], values[1]};
  }
  SetSize(map.node(), size, options, intrinsics);
  return {CameraModel(intrinsics, Eigen::Isometry3d::Identity()), format};
}

ForeignCamera FromKalibr(const YamlNode& node, const ForeignCameraOptions& options) {
  YamlMap map(node);
  const YamlNode model = map.Required("camera_model");
  if (model.As<std::string>() != "pinhole") {
    model.Fail(absl::StrCat("the camera model '", model.As<std::string>(),
                            "' is not held; calibrate with pinhole and radtan"));
  }
  const YamlNode distortion = map.Required("distortion_model");
  const auto name = distortion.As<std::string>();
  if (name != "radtan" && name != "none") {
    distortion.Fail(
        absl::StrCat("the distortion model '", name, "' is not held; calibrate with radtan"));
  }
  const std::vector<double> k = map.Required("intrinsics").Values<double>(4);
  CameraIntrinsics intrinsics{.fx = k[0], .fy = k[1], .cx = k[2], .cy = k[3]};
  if (name == "radtan") {
    const YamlNode coefficients = map.Required("distortion_coeffs");
    coefficients.Items(4);
    SetDistortion(coefficients, intrinsics);
  }
  const std::vector<int> size = map.Required("resolution").Values<int>(2);
  SetSize(node, std::array<int, 2>{size[0], size[1]}, options, intrinsics);
  return {CameraModel(intrinsics, Eigen::Isometry3d::Identity()), "Kalibr"};
}

ForeignCamera FromYaml(const YamlNode& root, const ForeignCameraOptions& options) {
  YamlMap map(root);
  if (const auto matrix =
          AnyOf(map, {"camera_matrix", "cameraMatrix", "camera_Matrix", "K", "k"})) {
    return FromMatrix(map, *matrix, options);
  }
  if (map.Optional("camera_model")) return FromKalibr(root, options);
  std::vector<std::string> cameras;
  for (const std::string& key : map.Keys()) {
    const YamlNode node = map.Required(key);
    if (!node.IsMap()) continue;
    YamlMap inner(node);
    if (inner.Optional("camera_model")) cameras.push_back(key);
  }
  if (cameras.empty()) {
    root.Fail(
        "no camera is found in it; a .cameramodel, OpenCV's or ROS's camera_matrix or Kalibr's "
        "camchain is expected");
  }
  std::string chosen = options.camera;
  if (chosen.empty() && cameras.size() == 1) chosen = cameras[0];
  if (std::find(cameras.begin(), cameras.end(), chosen) == cameras.end()) {
    root.Fail(absl::StrCat(chosen.empty() ? "say which camera is meant"
                                          : absl::StrCat("there is no camera '", chosen, "'"),
                           "; there are ", ListOfWords(cameras)));
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
      ASSIGN_OR_RETURN(const auto message, CameraFromText(text, file));
      const auto camera = CameraFrom(message);
      if (!camera.ok()) {
        return absl::InvalidArgumentError(absl::StrCat(file, ": ", camera.status().message()));
      }
      CameraIntrinsics checked = camera->intrinsics();
      SetSize(YamlNode::FromText("{}", file), std::array<int, 2>{checked.width, checked.height},
              options, checked);
      return ForeignCamera{*camera, "mrcal"};
    }
    return FromYaml(YamlNode::FromText(AsYaml(text), file), options);
  } catch (const YamlError& error) {
    return absl::InvalidArgumentError(error.what());
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": ", error.what()));
  }
}

}  // namespace silhouette
