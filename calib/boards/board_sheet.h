// Boards laid out on paper. All of a sheet is in millimetres from the paper's top left corner.
#pragma once

#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/canvas.h"
#include "calib/boards/paper.h"

namespace silhouette {

enum class SheetKind {
  kBoard,      // a grid of tags, with its measures
  kFlangeTag,  // one tag, with the frame of the flange that it is glued on
  kFloorTag,   // single tags, each with its axes and the numbers of its corners
};

struct PlacedBoard {
  Board board;
  PagePoint origin;  // where the board's origin is
  PageBox outline;   // along which it is cut out
};

struct BoardSheet {
  SheetKind kind = SheetKind::kBoard;
  Paper paper;
  std::vector<PlacedBoard> boards;
};

// Millimetres between the corners and the rim of a tag's print.
double PrintRim(const Board& board);

// `per_page` boards a sheet, all on one of `papers`: the first on which they fit. Throws
// std::invalid_argument, naming the mend: no board, single tags that are none, what CheckBoards
// refuses, boards that fit on none of the papers.
std::vector<BoardSheet> LayOutSheets(const std::vector<Board>& boards, SheetKind kind, int per_page,
                                     const std::vector<Paper>& papers);

// The sheet as a page to be drawn.
Page PageOf(const BoardSheet& sheet);

}  // namespace silhouette
