#include "capture/sim/yaml_values.h"

#include <vector>

namespace silhouette {

Eigen::Vector3d ReadVector(const YamlNode& node) {
  const std::vector<double> values = node.Values<double>(3);
  return {values[0], values[1], values[2]};
}

Eigen::Quaterniond ReadRotation(const YamlNode& node) {
  const std::vector<YamlNode> angles = node.Items(3);
  return Eigen::AngleAxisd(angles[2].AsAngle(), Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(angles[1].AsAngle(), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(angles[0].AsAngle(), Eigen::Vector3d::UnitX());
}

double ReadPositive(const YamlNode& node) {
  const double value = node.As<double>();
  if (!(value > 0)) node.Fail("a number greater than 0 is expected");
  return value;
}

double ReadNotNegative(const YamlNode& node) {
  const double value = node.As<double>();
  if (!(value >= 0)) node.Fail("a number not below 0 is expected");
  return value;
}

double ReadShare(const YamlNode& node) {
  const double value = node.As<double>();
  if (!(value >= 0 && value <= 1)) node.Fail("a number from 0 to 1 is expected");
  return value;
}

}  // namespace silhouette
