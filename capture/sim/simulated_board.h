// SPDX-License-Identifier: Apache-2.0
// Boards in the simulated cell: on the floor, on the robot, or held by somebody.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {

struct SimulatedBoard {
  Board board;
  double margin = 0;  // white paper around the print, metres
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

// BoardTexture: black and white on a board's paper, and exactly how much of each an area shows.

// x and y of the board's frame, metres. Cannot be changed once made and can be read by any number
// of threads.
class BoardTexture {
 public:
  using Quadrangle = std::array<Eigen::Vector2d, 4>;

  // `margin`: metres of white paper around the print. Throws std::invalid_argument if it is
  // negative, or CheckBoards refuses the board.
  BoardTexture(const Board& board, double margin);

  // The paper.
  const Eigen::AlignedBox2d& extent() const { return extent_; }

  // Whether a point of the paper is black.
  bool IsBlack(const Eigen::Vector2d& point) const;

  // The black share of a convex quadrangle's area, exactly, up to rounding.
  double BlackShare(const Quadrangle& area) const;

 private:
  // The black boxes that may meet these bounds, each once.
  std::vector<uint32_t> BoxesNear(const Eigen::AlignedBox2d& bounds) const;
  // The column or row of bins with a coordinate of the paper.
  size_t BinAt(double coordinate, int axis) const;

  Eigen::AlignedBox2d extent_;
  std::vector<Eigen::AlignedBox2d> black_;
  std::vector<std::vector<uint32_t>> bins_;  // the boxes that reach into each, row by row
};

}  // namespace silhouette
