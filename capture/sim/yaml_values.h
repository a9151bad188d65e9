// SPDX-License-Identifier: Apache-2.0
// Values that the simulated cell's files have in common. All throw YamlError.
#pragma once

#include <Eigen/Geometry>

#include "common/yaml/strict_yaml.h"

namespace silhouette {

// [x, y, z]
Eigen::Vector3d ReadVector(const YamlNode& node);

// The rotation by roll, pitch and yaw: angles about the fixed axes x, then y, then z, as in URDF.
Eigen::Quaterniond RotationOf(const Eigen::Vector3d& roll_pitch_yaw);
// The other way round; pitch from -90 to 90 degrees.
Eigen::Vector3d RollPitchYawOf(const Eigen::Matrix3d& rotation);

// [roll, pitch, yaw], as RotationOf.
Eigen::Quaterniond ReadRotation(const YamlNode& node);

// [red, green, blue], each from 0 to 1.
Eigen::Vector3d ReadColour(const YamlNode& node);
// The same, as multiples of its luminance; a colour that is not black.
Eigen::Vector3d ReadTint(const YamlNode& node);

// What a grey camera sees of a colour: red, green, blue.
double Luminance(const Eigen::Vector3d& colour);
// The colour as multiples of its luminance; of black: grey.
Eigen::Vector3d TintOf(const Eigen::Vector3d& colour);

}  // namespace silhouette
