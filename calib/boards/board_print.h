// SPDX-License-Identifier: Apache-2.0
// BoardPrint: what of a board is black on its paper.
//
// A circle is printed in strips that have its area.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calib/boards/board.h"

namespace silhouette {

// In the board's frame, metres. No two boxes overlap.
struct BoardPrint {
  Eigen::AlignedBox2d extent;  // of the print, with the white modules that belong to tags
  std::vector<Eigen::AlignedBox2d> black;
};

// With Kalibr's tags come the black squares that it prints between them. Throws
// std::invalid_argument for a board that CheckBoards refuses.
BoardPrint PrintOf(const Board& board);

// Metres between the corners and the rim of the print.
double PrintRim(const Board& board);

}  // namespace silhouette
