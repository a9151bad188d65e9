// A body as the simulated cell's files describe it: a shape, where it is, how bright.
#pragma once

#include <Eigen/Geometry>
#include <string>

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

}  // namespace silhouette
