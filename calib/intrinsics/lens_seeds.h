// Where a solve starts from: rough focal lengths and the poses of boards before their cameras.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "calib/intrinsics/board_views.h"

namespace silhouette {

// Of board views' corners, seen by a camera without distortion, of that focal length and with the
// principal point `centre`: how the board stood. Nothing if the corners are those of no board.
std::optional<Eigen::Isometry3d> CameraFromBoard(const std::vector<Eigen::Vector3d>& corners,
                                                 const Lattice& lattice, double focal_length,
                                                 const Eigen::Vector2d& centre);

// The focal length, out of a range that goes by the image's size, with which the views are nearest
// to those of boards.
double GuessFocalLength(const std::vector<const BoardView*>& views, const Lattice& lattice,
                        int width, int height);

}  // namespace silhouette
