// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/simulation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "capture/sim/yaml_values.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {
namespace {

constexpr double kMostBlur = 20;  // pixels

Eigen::Isometry3d ReadPose(YamlMap& map) {
  const Eigen::Vector3d position = ReadVector(map.Required("position"));
  const auto look_at = map.Optional("look_at");
  const auto up = map.Optional("up");
  const auto rotation = map.Optional("rotation");
  if (look_at.has_value() == rotation.has_value()) {
    map.node().Fail("a camera needs either 'look_at' or 'rotation'");
  }
  if (rotation) {
    if (up) up->Fail("'up' goes with 'look_at' only");
    const Eigen::Isometry3d world_from_camera =
        Eigen::Translation3d(position) * ReadRotation(*rotation);
    return world_from_camera.inverse();
  }
  const Eigen::Vector3d forward = ReadVector(*look_at) - position;
  if (forward.norm() < 1e-6) look_at->Fail("the camera cannot look at its own place");
  // Looking straight down, upward in the image is the world's y.
  const bool vertical = forward.head<2>().norm() < 1e-6 * forward.norm();
  const Eigen::Vector3d upward =
      up ? ReadVector(*up) : (vertical ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ());
  if (forward.normalized().cross(upward).norm() < 1e-6) {
    (up ? *up : *look_at).Fail("'up' must not point along the view");
  }
  return LookAt(position, position + forward, upward);
}

void ReadFocalLength(YamlMap& map, CameraIntrinsics& intrinsics) {
  const auto focal_length = map.Optional("focal_length");
  const auto field_of_view = map.Optional("field_of_view");
  if (focal_length.has_value() == field_of_view.has_value()) {
    map.node().Fail("a camera needs either 'focal_length' in pixels or 'field_of_view'");
  }
  if (focal_length) {
    intrinsics.fx = intrinsics.fy = focal_length->AsPositive();
    return;
  }
  const double angle = field_of_view->AsAngle();
  if (!(angle > 0 && angle < 0.95 * std::numbers::pi)) {
    field_of_view->Fail("an angle above 0 and below 170 deg is expected");
  }
  intrinsics.fx = intrinsics.fy = 0.5 * intrinsics.width / std::tan(angle / 2);
}

void ReadDistortion(const YamlNode& node, CameraIntrinsics& intrinsics) {
  const std::vector<double> values = node.Values<double>();
  if (values.size() != 4 && values.size() != 5 && values.size() != 8) {
    node.Fail("4, 5 or 8 numbers are expected: k1, k2, p1, p2, k3, k4, k5, k6");
  }
  std::copy(values.begin(), values.end(), intrinsics.distortion.begin());
}

SimulatedCamera ReadCamera(const std::string& name, const YamlNode& node) {
  YamlMap map(node);
  const YamlNode size = map.Required("image_size");
  const std::vector<int> sides = size.Values<int>(2);
  if (sides[0] < 1 || sides[1] < 1 || sides[0] > 10000 || sides[1] > 10000) {
    size.Fail("each side of an image is 1 to 10000 pixels");
  }
  CameraIntrinsics intrinsics{.width = sides[0], .height = sides[1]};
  intrinsics.cx = 0.5 * (sides[0] - 1);
  intrinsics.cy = 0.5 * (sides[1] - 1);
  ReadFocalLength(map, intrinsics);
  if (const auto point = map.Optional("principal_point")) {
    const std::vector<double> values = point->Values<double>(2);
    intrinsics.cx = values[0];
    intrinsics.cy = values[1];
  }
  if (const auto distortion = map.Optional("distortion")) ReadDistortion(*distortion, intrinsics);
  const Eigen::Isometry3d camera_from_world = ReadPose(map);
  const bool coloured = map.Get<bool>("colour", false);
  map.Finish();
  const CameraModel model(intrinsics, camera_from_world);
  for (int corner = 0; corner < 4; ++corner) {
    if (!model.Ray({corner % 2 * (sides[0] - 1), corner / 2 * (sides[1] - 1)})) {
      node.Fail("the distortion folds back before it reaches the image's corners");
    }
  }
  return {name, model, coloured};
}

std::vector<SimulatedCamera> ReadCameras(const YamlNode& node) {
  std::vector<SimulatedCamera> cameras;
  YamlMap map(node);
  for (const std::string& name : map.Keys()) {
    cameras.push_back(ReadCamera(name, map.Required(name)));
  }
  if (cameras.empty() || cameras.size() > kMaxSimulatedCameras) {
    node.Fail("1 to 8 cameras are expected");
  }
  return cameras;
}

Light ReadLight(const YamlNode& node) {
  YamlMap map(node);
  Light light;
  if (const auto direction = map.Optional("direction")) {
    light.direction = ReadVector(*direction);
    if (!(light.direction.z() < -0.1 * light.direction.norm())) {
      direction->Fail("the light comes from above: its z must be clearly below 0");
    }
    light.direction.normalize();
  }
  map.Read("ambient", light.ambient, &YamlNode::AsShare);
  map.Read("shadow", light.shadow, &YamlNode::AsShare);
  map.Finish();
  return light;
}

Room ReadRoom(const YamlNode& node) {
  YamlMap map(node);
  Room room;
  map.Read("lower", room.lower, ReadVector);
  map.Read("upper", room.upper, ReadVector);
  map.Read("brightness", room.brightness, &YamlNode::AsShare);
  map.Read("texture", room.texture, &YamlNode::AsShare);
  map.Read("colour", room.tint, ReadTint);
  map.Finish();
  if (!((room.upper - room.lower).minCoeff() > 0)) {
    node.Fail("'upper' must be greater than 'lower' along every axis");
  }
  return room;
}

SimulationSettings ReadSimulation(const YamlNode& node) {
  YamlMap map(node);
  SimulationSettings settings;
  const YamlNode cameras = map.Required("cameras");
  settings.cameras = ReadCameras(cameras);
  map.Read("light", settings.light, ReadLight);
  map.Read("room", settings.room, ReadRoom);
  map.Read("boards", settings.boards, ReadBoards);
  map.Read("parts", settings.parts, ReadCarriedParts);
  map.Read("blur", settings.blur, &YamlNode::AsNotNegative);
  if (settings.blur > kMostBlur) {
    map.Required("blur").Fail("a blur of at most 20 pixels is expected");
  }
  map.Read("noise", settings.noise_sigma, &YamlNode::AsNotNegative);
  if (const auto drift = map.Optional("drift")) {
    YamlMap drift_map(*drift);
    settings.drift_amplitude = drift_map.Required("amplitude").AsShare();
    drift_map.Read("slope", settings.drift_slope, &YamlNode::AsShare);
    settings.drift_period = absl::ToDoubleSeconds(drift_map.Required("period").AsPositiveTime());
    drift_map.Finish();
  }
  map.Read("exposure", settings.exposure, &YamlNode::AsPositive);
  if (const auto flicker = map.Optional("flicker")) {
    YamlMap flicker_map(*flicker);
    settings.flicker_amplitude = flicker_map.Required("amplitude").AsShare();
    flicker_map.Read("slope", settings.flicker_slope, &YamlNode::AsShare);
    flicker_map.Finish();
  }
  if (const auto unsteady = map.Optional("unsteady_pixels")) {
    YamlMap unsteady_map(*unsteady);
    settings.unsteady_share = unsteady_map.Required("share").AsShare();
    unsteady_map.Read("jump", settings.unsteady_jump, &YamlNode::AsNotNegative);
    unsteady_map.Finish();
  }
  if (const auto seed = map.Optional("seed")) {
    const int value = seed->As<int>();
    if (value < 0) seed->Fail("a number not below 0 is expected");
    settings.seed = static_cast<uint64_t>(value);
  }
  map.Read("frame_interval", settings.frame_interval, &YamlNode::AsSeconds);
  map.Read("joint_speed", settings.joint_speed, &YamlNode::AsAngle);
  if (!(settings.joint_speed >= 0)) {
    map.Required("joint_speed").Fail("a speed not below 0 is expected");
  }
  map.Finish();
  for (const SimulatedCamera& camera : settings.cameras) {
    const Eigen::Vector3d centre = camera.model.Centre();
    if (!((centre - settings.room.lower).minCoeff() > 0 &&
          (settings.room.upper - centre).minCoeff() > 0)) {
      cameras.Fail("the camera '" + camera.name + "' stands outside the room");
    }
  }
  return settings;
}

}  // namespace

absl::StatusOr<SimulationSettings> LoadSimulation(const std::string& path) {
  try {
    return ReadSimulation(YamlNode::FromFile(path));
  } catch (const YamlError& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

Eigen::Isometry3d LookAt(const Eigen::Vector3d& position, const Eigen::Vector3d& look_at,
                         const Eigen::Vector3d& up) {
  const Eigen::Vector3d forward = (look_at - position).normalized();
  const Eigen::Vector3d right = forward.cross(up).normalized();
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  world_from_camera.linear().col(0) = right;
  world_from_camera.linear().col(1) = forward.cross(right);
  world_from_camera.linear().col(2) = forward;
  world_from_camera.translation() = position;
  return world_from_camera.inverse();
}

}  // namespace silhouette
