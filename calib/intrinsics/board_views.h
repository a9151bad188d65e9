// SPDX-License-Identifier: Apache-2.0
// BoardView: one board in one image, as the lattice that mrcal wants.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

struct BoardView {
  std::string frame;
  // Views of one stand show the board at one place: those of a frame; each by itself if the board
  // is ambiguous.
  std::string stand;
  size_t camera = 0;
  size_t board = 0;
  // Row by row, as LensProblem::corners: pixel x, y, and 1 / sigma or kNoCorner.
  std::vector<Eigen::Vector3d> corners;
  int seen = 0;  // corners
  // What was added to the corners' pixels, as where the lattice has them is not where the board
  // does; empty if the lattice is exact.
  std::vector<Eigen::Vector2d> shifts = {};

  Eigen::Vector2d ShiftOf(size_t corner) const {
    return shifts.empty() ? Eigen::Vector2d::Zero() : shifts[corner];
  }
};

// Which corner of BoardView::corners a corner of a mark of the board, which has a lattice, is.
size_t LatticeIndex(const Board& board, int id, int corner);

struct BoardViews {
  std::vector<BoardView> views;
  Lattice lattice;             // of all boards that were used
  std::vector<size_t> boards;  // those that were seen
  std::vector<std::string> warnings;
};

// Where a board's lattice is not exact, the corners of each tag are moved to where those on the
// lattice would be seen: by the homography of the tag, which is as bent as the lens around it.
// InvalidArgument: no sighting of these boards, a board without a lattice, boards of different
// lattices, a camera without an image size, a corner outside the image, a tag twice in an image,
// mirrored images or boards. Tags with a corner just beyond the image's rim are left out.
absl::StatusOr<BoardViews> GatherBoardViews(const std::vector<LensCamera>& cameras,
                                            const std::vector<Board>& boards,
                                            const std::vector<TagSighting>& sightings);

// Whether boards look in the images as their descriptions say: a plane seen through a lens is
// nearly a homography of itself, and of nothing else.

// InvalidArgument, with what seems to be the matter, if most views of a board contradict its
// description: mirrored, rows and columns exchanged, another order of tags.
absl::Status CheckBoardShapes(const std::vector<LensCamera>& cameras,
                              const std::vector<Board>& boards,
                              const std::vector<BoardView>& views);

// How cameras stand to each other, from boards that they saw at once; and which of the images that
// are said to be taken at once cannot have been.

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
