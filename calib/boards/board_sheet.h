// SPDX-License-Identifier: Apache-2.0
// Boards laid out on paper. All of a sheet is in millimetres from the paper's top left corner.
#pragma once

#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/canvas.h"

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

// `per_page` boards a sheet, all on one of `papers`: the first on which they fit. Throws
// std::invalid_argument, naming the mend: no board, single tags that are none, what CheckBoards
// refuses, boards that fit on none of the papers.
std::vector<BoardSheet> LayOutSheets(const std::vector<Board>& boards, SheetKind kind, int per_page,
                                     const std::vector<Paper>& papers);

// The sheet as a page to be drawn.
Page PageOf(const BoardSheet& sheet);

// How a sheet is divided; millimetres.

inline constexpr double kUnprintable = 5;  // what printers leave white at the paper's rim
inline constexpr double kCutMark = 4;      // length of the marks outside an outline
inline constexpr double kPageMargin = kUnprintable + kCutMark + 1;
inline constexpr double kBetweenPieces = 2 * kCutMark + 2;
inline constexpr double kFooter = 17.5;  // notes on printing, below all

// Inside the outline of a piece.
struct SheetMeasures {
  double band = 8;     // around the tags' print: axes, measures
  double caption = 9;  // below that
};

inline SheetMeasures MeasuresOf(SheetKind kind) {
  if (kind == SheetKind::kFlangeTag) return {.band = 17, .caption = 9};
  if (kind == SheetKind::kFloorTag) return {.band = 10, .caption = 9};
  return {};
}

}  // namespace silhouette
