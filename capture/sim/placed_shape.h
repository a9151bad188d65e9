// SPDX-License-Identifier: Apache-2.0
// A body as the simulated cell's files describe it: a shape, where it is, how bright.
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/robot_model.h"
#include "calib/robot/triangle_mesh.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {

struct PlacedShape {
  TriangleMesh mesh;  // closed, in its own frame
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  double brightness = 0.1;  // share of the light that it throws back, 0..1
  // Red, green and blue, each as a multiple of the brightness.
  Eigen::Vector3d tint = Eigen::Vector3d::Ones();
};

// Reads the keys of one: box, sphere, capsule, cylinder or mesh; position, rotation; brightness or
// colour. `what`: what errors call it, e.g. "an obstacle". Paths of meshes are relative to
// `folder`. Throws YamlError.
PlacedShape ReadPlacedShape(YamlMap& map, const std::string& what, const std::string& folder);

// What the simulated robot carries, by the variant: the section `parts` of
// simulation.yaml.

struct CarriedPart {
  std::string link;   // of the robot
  PlacedShape shape;  // its pose is in the link's frame
};

// By the name of the variant.
using CarriedParts = std::map<std::string, std::vector<CarriedPart>>;

// The variant of a robot that carries nothing, where the file says nothing else of it.
inline constexpr char kBareVariant[] = "default";

// Paths of meshes are relative to the file. Throws YamlError.
CarriedParts ReadCarriedParts(const YamlNode& node);

// The robot with what it carries, for pictures and truth alike. Where there are no parts at all, it
// is the same for every variant. InvalidArgument: there are some, but none for `variant`; a part is
// on a link that the robot does not have.
absl::StatusOr<RobotModel> Carrying(const RobotModel& robot, const CarriedParts& parts,
                                    const std::string& variant);

}  // namespace silhouette
