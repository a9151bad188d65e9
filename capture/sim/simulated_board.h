// Boards of tags in the simulated cell: on the floor, on the robot, or held by somebody.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {

struct SimulatedBoard {
  Board board;
  double margin = 0;  // white paper around the tags' prints, metres
  // The link of the robot that carries it; empty: it stands in the world.
  std::string link = "";
  // The pose of the board's frame in that of the link, or in the world; nothing: it is held, and is
  // only seen when and where SimulatedCell::HoldBoard says.
  std::optional<Eigen::Isometry3d> pose = std::nullopt;
  bool always = true;  // false: in the cell only for calibration (SimulatedCell::ShowAllBoards)
};

// The section `boards` of simulation.yaml; capture/sim/cells/calibration/simulation.yaml is the
// commented sample. Throws YamlError.
std::vector<SimulatedBoard> ReadBoards(const YamlNode& node);

}  // namespace silhouette
