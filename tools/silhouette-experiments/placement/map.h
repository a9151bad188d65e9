// The cell from above, with the places of cameras.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/picture/picture.h"

namespace silhouette {

enum class PlaceKind { kUnusable, kNotChosen, kChosen };

struct MappedPlace {
  PlaceKind kind = PlaceKind::kNotChosen;
  std::string label;  // of a chosen one
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d look_at = Eigen::Vector3d::Zero();
};

struct PlaceMap {
  std::string title;
  std::vector<MappedPlace> places;
  double field_of_view = 0;                // radians, of every camera
  std::vector<Eigen::Vector2d> footprint;  // points of the robot; their hull is drawn
};

// Metres along the axes, x to the right, y up.
Picture Draw(const PlaceMap& map);

}  // namespace silhouette
