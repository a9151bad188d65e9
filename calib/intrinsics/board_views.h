// BoardView: one board in one image, as the lattice that mrcal wants.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

struct BoardView {
  std::string frame;
  size_t camera = 0;
  size_t board = 0;
  // Row by row, as LensProblem::corners: pixel x, y, and 1 / sigma or kNoCorner.
  std::vector<Eigen::Vector3d> corners;
  int seen = 0;  // corners
};

// A lattice of corner points.
struct Lattice {
  int width = 0;
  int height = 0;
  double spacing = 0;
};
Lattice LatticeOf(const Board& board);

// Where on the lattice the corner of the tag with the place `place` on the board is.
size_t LatticeIndex(const Board& board, int place, int corner);

struct BoardViews {
  std::vector<BoardView> views;
  Lattice lattice;             // of all boards that were used
  std::vector<size_t> boards;  // those that were seen
  std::vector<std::string> warnings;
};

// InvalidArgument: no sighting of these boards, a board that is no lattice, boards of different
// lattices, a camera without an image size, a corner outside the image, a tag twice in an image,
// mirrored images or boards. Tags with a corner just beyond the image's rim are left out.
absl::StatusOr<BoardViews> GatherBoardViews(const std::vector<LensCamera>& cameras,
                                            const std::vector<Board>& boards,
                                            const std::vector<TagSighting>& sightings);

}  // namespace silhouette
