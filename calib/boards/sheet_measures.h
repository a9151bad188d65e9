// How a sheet is divided; millimetres.
#pragma once

#include "calib/boards/board_sheet.h"

namespace silhouette {

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
