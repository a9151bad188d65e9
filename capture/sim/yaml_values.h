// Values that the simulated cell's files have in common. All throw YamlError.
#pragma once

#include <Eigen/Geometry>

#include "tools/yaml/strict_yaml.h"

namespace silhouette {

// [x, y, z]
Eigen::Vector3d ReadVector(const YamlNode& node);

// The rotation by roll, pitch and yaw: angles about the fixed axes x, then y, then z, as in URDF.
Eigen::Quaterniond RotationOf(const Eigen::Vector3d& roll_pitch_yaw);
// The other way round; pitch from -90 to 90 degrees.
Eigen::Vector3d RollPitchYawOf(const Eigen::Matrix3d& rotation);

// [roll, pitch, yaw], as RotationOf.
Eigen::Quaterniond ReadRotation(const YamlNode& node);

// A number greater than 0.
double ReadPositive(const YamlNode& node);

// A number not below 0.
double ReadNotNegative(const YamlNode& node);

// A number from 0 to 1.
double ReadShare(const YamlNode& node);

}  // namespace silhouette
