// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/yaml_values.h"

#include <cmath>
#include <vector>

namespace silhouette {

Eigen::Vector3d ReadVector(const YamlNode& node) {
  const std::vector<double> values = node.Values<double>(3);
  return {values[0], values[1], values[2]};
}

Eigen::Quaterniond RotationOf(const Eigen::Vector3d& roll_pitch_yaw) {
  return Eigen::AngleAxisd(roll_pitch_yaw[2], Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(roll_pitch_yaw[1], Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll_pitch_yaw[0], Eigen::Vector3d::UnitX());
}

Eigen::Vector3d RollPitchYawOf(const Eigen::Matrix3d& r) {
  return {std::atan2(r(2, 1), r(2, 2)), std::atan2(-r(2, 0), std::hypot(r(0, 0), r(1, 0))),
          std::atan2(r(1, 0), r(0, 0))};
}

Eigen::Quaterniond ReadRotation(const YamlNode& node) {
  const std::vector<YamlNode> angles = node.Items(3);
  return RotationOf({angles[0].AsAngle(), angles[1].AsAngle(), angles[2].AsAngle()});
}

Eigen::Vector3d ReadColour(const YamlNode& node) {
  const Eigen::Vector3d colour = ReadVector(node);
  if (!(colour.minCoeff() >= 0 && colour.maxCoeff() <= 1)) {
    node.Fail("red, green and blue are expected, each from 0 to 1");
  }
  return colour;
}

Eigen::Vector3d ReadTint(const YamlNode& node) {
  const Eigen::Vector3d colour = ReadColour(node);
  if (!(Luminance(colour) > 0)) node.Fail("a colour that is not black is expected");
  return TintOf(colour);
}

double Luminance(const Eigen::Vector3d& colour) {
  return colour.dot(Eigen::Vector3d(0.299, 0.587, 0.114));
}

Eigen::Vector3d TintOf(const Eigen::Vector3d& colour) {
  const double luminance = Luminance(colour);
  return luminance > 0 ? Eigen::Vector3d(colour / luminance) : Eigen::Vector3d::Ones();
}

}  // namespace silhouette
