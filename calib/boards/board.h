// SPDX-License-Identifier: Apache-2.0
// Board: marks in a grid on a plane, by which cameras are calibrated. A plain value once it is
// made.
//
// A mark is what detection finds as one: an AprilTag with its four corners, a single corner of a
// chessboard, or a circle, whose middle stands for a corner. The board's frame is that of its
// print: the origin at the top left corner of all that detection finds, x to the right, y down, z
// into the paper; metres. A tag's corners are those that detection finds - for the families with a
// ring of data around the border (tagStandard41h12, ...) the border's outer edge, not the print's -
// in AprilTag's order: bottom left, bottom right, top right, top left.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace silhouette {

// Of one mark, in the board's frame: four of a tag, else one.
using MarkCorners = std::vector<Eigen::Vector3d>;

enum class BoardKind {
  kTags,        // AprilTags or ArUco markers, black on white, with gaps between them
  kChessboard,  // squares; its marks are the inner corners
  kCharuco,     // a chessboard with ArUco markers in its white squares; marks: the inner corners
  kCircles,     // black discs on white; marks: their middles
};

struct BoardDescription {
  std::string name;  // what messages and files call it
  BoardKind kind = BoardKind::kTags;
  std::string family = "tagStandard41h12";  // tags: as of TagFamily
  std::string dictionary = "DICT_4X4_50";   // ChArUco: OpenCV's name of it
  // Of tags; of a chessboard's inner corners; of a ChArUco board's squares; of circles.
  int rows = 1;
  int columns = 1;
  double tag_size = 0;  // tags: from corner to corner; ChArUco: a marker's side; metres
  double gap = 0;       // tags: between corners of neighbours, metres; 0 for a single tag
  // Metres. Chessboard, ChArUco: a square's side. Circles: from a row to the next, and from a
  // column to the next, which in an asymmetric board is half the distance of neighbours in a row.
  double square = 0;
  int first_id = 0;  // tags, ChArUco: ids go row by row from here
  // Tags: the first row of ids is the lowest, not the topmost (Kalibr's AprilGrid).
  bool from_bottom = false;
  // ChArUco: as OpenCV before 4.6 drew boards with an even number of rows, with a marker, not a
  // black square, in the top left corner. Boards with an odd number are the same.
  bool legacy = false;
  // Circles: every second row, from the second one on, lies between the columns of the first.
  bool asymmetric = false;
};

// Between the middles of nearest neighbours of a board of circles, metres.
double NeighbourDistance(const BoardDescription& circles);

// A regular lattice of points in the board's plane, its first one at the board's origin.
struct Lattice {
  int width = 0;
  int height = 0;
  double spacing = 0;  // metres
  // Whether the board's corners lie on it. If not, the first corner of each tag does, and the tag
  // is some per cent larger or smaller than its places.
  bool exact = true;
  bool operator==(const Lattice&) const = default;
};

struct GridSize {
  int columns = 0;
  int rows = 0;
};
// "9x6": columns x rows. Nothing if the text is not so.
std::optional<GridSize> GridSizeFromText(const std::string& text);

// A place in a grid, from the board's origin.
struct GridPlace {
  int row = 0;
  int column = 0;
};

// Whether marks of this family (Board::family) are of an ambiguous board.
bool IsAmbiguousFamily(const std::string& family);

class Board {
 public:
  // Throws std::invalid_argument: no name, no row or column, a size that is not positive, several
  // tags without a gap, a marker that is not smaller than its square, a chessboard of less than 3 x
  // 3 squares or less than 2 x 2 circles, more than a million marks, a negative or immense id.
  explicit Board(BoardDescription description);

  const BoardDescription& description() const { return description_; }
  // How many marks it has.
  int tags() const { return mark_rows() * mark_columns(); }
  int corners_per_mark() const { return description_.kind == BoardKind::kTags ? 4 : 1; }
  // What its marks are called in sightings: the tags' family; else kind and size, such as
  // "chessboard-9x6" or "asymmetric-circles-4x11" (columns x rows), or "chessboard-8x8-symmetric"
  // of an ambiguous one.
  const std::string& family() const { return family_; }
  // The id of its first mark; the others follow.
  int first_mark() const {
    return description_.kind == BoardKind::kTags ? description_.first_id : 0;
  }

  bool HasTag(int id) const { return id >= first_mark() && id - first_mark() < tags(); }
  bool HasTag(const std::string& family, int id) const { return family == family_ && HasTag(id); }
  // Throws std::out_of_range if the board does not have the mark.
  MarkCorners CornersOf(int id) const;

  // From the origin to the opposite corner of all that is detected, metres.
  Eigen::Vector2d extent() const;

  // Whether it looks the same when it is turned by half, so that its frame is not certain: a
  // chessboard with an even number of rows and columns together, circles but for an asymmetric
  // board of an odd number of rows.
  bool IsAmbiguous() const { return IsAmbiguousFamily(family_); }

  // The coarsest lattice of 20 places a tag and 6400 in all, or less, that has all corners, to a
  // ten thousandth of a tag; else one that has them nearly. Nothing: there are too many tags for
  // the gap, which is not near a simple fraction of the tag's size, or too wide.
  std::optional<Lattice> lattice() const;
  // Where on it a corner of a mark is. Throws std::out_of_range as CornersOf, std::logic_error if
  // there is no lattice.
  GridPlace LatticePlaceOf(int id, int corner) const;

 private:
  // Of the grid of marks.
  int mark_rows() const;
  int mark_columns() const;
  // A mark's place in it. Throws std::out_of_range.
  GridPlace PlaceOf(int id) const;
  // Of marks with a single corner: how many `square`s one is from the origin, and the farthest.
  GridPlace SquaresTo(GridPlace place) const;
  GridPlace MostSquares() const;
  // Lattice places along a tag, and from a tag to the next; 0 if there is no lattice.
  struct Steps {
    int tag = 0;
    int pitch = 0;
  };
  Steps LatticeSteps() const;
  // Along a row or column of marks.
  static int Places(int marks, const Steps& steps);

  BoardDescription description_;
  std::string family_;
};

// The boards of a calibration session as a YAML file: a list of
//
//   - name: wall                  # as messages call it
//     family: tagStandard41h12    # of its tags; this one if not said; or OpenCV's dictionary
//     rows: 4                     # of tags; 1 if not said
//     columns: 6
//     tag_size: 0.040             # metres, from corner to corner
//     gap: 0.040                  # metres, between the corners of neighbours
//     first_id: 0                 # ids go row by row from here; 0 if not said
//     first_row: top              # or bottom; top if not said
//   - name: hand
//     chessboard: 9x6             # inner corners, columns x rows
//     square: 0.025               # metres
//   - name: plate
//     charuco: 7x5                # squares, columns x rows
//     square: 0.040               # metres
//     marker: 0.030               # metres, a marker's side
//     dictionary: DICT_4X4_50     # this one if not said
//     first_id: 0                 # 0 if not said
//     legacy: false               # true: drawn by OpenCV before 4.6; false if not said
//   - name: dots
//     circles: 4x11               # columns x rows
//     spacing: 0.020              # metres, from a row to the next
//     asymmetric: true            # every second row is moved by a spacing; false if not said
//
// or one board as Kalibr describes it (target_type: aprilgrid, checkerboard or circlegrid).

// A tag that is larger, in metres, is taken for one in other units.
inline constexpr double kLargestTag = 3;

// What keeps the boards from being used in one session: an unknown family, ids that the family does
// not have, prints of neighbouring tags that overlap, a tag_size above kLargestTag, two boards of
// one name, a tag on two boards (DICT_4X4_50 has the first markers of DICT_4X4_1000, and
// DICT_APRILTAG_36h11 the tags of tag36h11). OK: nothing. InvalidArgument, naming the boards.
absl::Status CheckBoards(std::span<const Board> boards);

std::string BoardFileText(std::span<const Board> boards);

// `file`: what messages call it. InvalidArgument with file and line: not such a list, a key that is
// missing or unknown, what Board and CheckBoards refuse.
absl::StatusOr<std::vector<Board>> BoardsFromText(const std::string& text, const std::string& file);

}  // namespace silhouette
