// How cameras stand to each other, from boards that they saw at once; and which of the images that
// are said to be taken at once cannot have been.
#pragma once

#include <string>
#include <vector>

#include "calib/intrinsics/board_views.h"

namespace silhouette {

// A board view with the board's pose before its camera.
struct PosedView {
  const BoardView* view = nullptr;
  Eigen::Isometry3d camera_from_board = Eigen::Isometry3d::Identity();
};

// One stand of one board, and who saw it.
struct Placing {
  size_t group = 0;
  Eigen::Isometry3d reference_from_board = Eigen::Isometry3d::Identity();
  std::vector<size_t> views;  // of those given
};

struct CameraTies {
  std::vector<std::vector<size_t>> groups;  // of cameras; the first one's frame is the reference
  std::vector<Eigen::Isometry3d> camera_from_reference;  // of each camera
  // Views of one frame that contradict each other are placings of their own.
  std::vector<Placing> placings;
  std::vector<std::string> warnings;
};

// InvalidArgument if images that are said to be taken at once contradict each other throughout.
absl::StatusOr<CameraTies> TieCameras(const std::vector<LensCamera>& cameras,
                                      const std::vector<PosedView>& views);

}  // namespace silhouette
