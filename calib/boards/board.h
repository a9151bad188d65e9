// SPDX-License-Identifier: Apache-2.0
// Board: AprilTags in a grid on a plane, or a single tag. A plain value once it is made.
//
// The board's frame is that of its print: the origin at the top left corner of the first tag, x to
// the right, y down, z into the paper; metres. A tag's corners are those that detection finds - for
// the families with a ring of data around the border (tagStandard41h12, ...) the border's outer
// edge, not the print's - in AprilTag's order: bottom left, bottom right, top right, top left.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace silhouette {

using TagCorners = std::array<Eigen::Vector3d, 4>;

struct BoardDescription {
  std::string name;                         // what messages and files call it
  std::string family = "tagStandard41h12";  // the AprilTag library's name of it
  int rows = 1;                             // of tags
  int columns = 1;
  double tag_size = 0;  // from corner to corner, metres
  double gap = 0;       // between corners of neighbours; 0 for a single tag
  int first_id = 0;     // ids go row by row from here
};

class Board {
 public:
  // Throws std::invalid_argument: no name, no row or column, a size that is not positive, several
  // tags without a gap, more than a million tags, a negative or immense id.
  explicit Board(BoardDescription description);

  const BoardDescription& description() const { return description_; }
  int tags() const { return description_.rows * description_.columns; }

  bool HasTag(int id) const;
  bool HasTag(const std::string& family, int id) const {
    return family == description_.family && HasTag(id);
  }
  // Throws std::out_of_range if the board does not have the tag.
  TagCorners CornersOf(int id) const;

  // Whether all corners together are one regular lattice, 2 * rows by 2 * columns, as mrcal wants
  // them.
  bool IsLattice() const;

 private:
  BoardDescription description_;
};

// The boards of a calibration session as a YAML file: a list of
//
//   - name: wall                  # as messages call it
//     family: tagStandard41h12    # of its tags; this one if not said
//     rows: 4                     # of tags; 1 if not said
//     columns: 6
//     tag_size: 0.040             # metres, from corner to corner
//     gap: 0.040                  # metres, between the corners of neighbours
//     first_id: 0                 # ids go row by row from here; 0 if not said

// A tag that is larger, in metres, is taken for one in other units.
inline constexpr double kLargestTag = 3;

// What keeps the boards from being used in one session: an unknown family, ids that the family does
// not have, prints of neighbouring tags that overlap, a tag_size above kLargestTag, two boards of
// one name, a tag on two boards. OK: nothing. InvalidArgument, naming the boards.
absl::Status CheckBoards(std::span<const Board> boards);

std::string BoardFileText(std::span<const Board> boards);

// `file`: what messages call it. InvalidArgument with file and line: not such a list, a key that is
// missing or unknown, what Board and CheckBoards refuse.
absl::StatusOr<std::vector<Board>> BoardsFromText(const std::string& text, const std::string& file);

}  // namespace silhouette
