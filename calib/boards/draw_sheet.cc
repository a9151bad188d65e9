// SPDX-License-Identifier: Apache-2.0
// What is drawn on a sheet.
#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/boards/board_print.h"
#include "calib/boards/board_sheet.h"
#include "calib/boards/tag_family.h"

namespace silhouette {
namespace {

constexpr double kHair = 0.15;  // widths of lines
constexpr double kLine = 0.3;
constexpr double kText = 2.8;  // heights of text
constexpr double kSmallText = 2.2;
constexpr double kInk = 0;
constexpr double kFaint = 0.55;

std::string Mm(double mm) { return absl::StrFormat("%.1f mm", mm); }
// Without needless digits.
std::string Plain(double mm) { return absl::StrCat(std::round(mm * 1e4) / 1e4); }

// A board on the page in millimetres.
struct Piece {
  explicit Piece(const PlacedBoard& board)
      : placed(board),
        d(board.board.description()),
        side(1000 * (d.kind == BoardKind::kTags ? d.tag_size : d.square)),
        rim(1000 * PrintRim(board.board)),
        square{board.origin.x, board.origin.y, 1000 * board.board.extent().x(),
               1000 * board.board.extent().y()},
        print{square.left - rim, square.top - rim, square.width + 2 * rim,
              square.height + 2 * rim} {}

  const PlacedBoard& placed;
  const BoardDescription& d;
  double side;  // of a tag, or of a square
  double rim;
  PageBox square;  // around all corners
  PageBox print;
};

void DrawPrint(Canvas& canvas, const Piece& piece) {
  std::vector<PageBox> black;
  for (const Eigen::AlignedBox2d& box : PrintOf(piece.placed.board).black) {
    const Eigen::Vector2d size = 1000 * box.sizes();
    black.push_back({piece.square.left + 1000 * box.min().x(),
                     piece.square.top + 1000 * box.min().y(), size.x(), size.y()});
  }
  canvas.Fill(black);
}

void DrawCutMarks(Canvas& canvas, const PageBox& outline) {
  for (const double x : {outline.left, outline.right()}) {
    for (const double y : {outline.top, outline.bottom()}) {
      const double out_x = x == outline.left ? -1 : 1;
      const double out_y = y == outline.top ? -1 : 1;
      canvas.Line({x + out_x, y}, {x + out_x * (1 + kCutMark), y}, kHair);
      canvas.Line({x, y + out_y}, {x, y + out_y * (1 + kCutMark)}, kHair);
    }
  }
}

// The board's axes, beside the print where they begin.
void DrawAxes(Canvas& canvas, const Piece& piece, double away) {
  const double length = std::min(15.0, piece.side);
  const double x = piece.print.left - away;
  const double y = piece.print.top - away;
  const PageBox& s = piece.square;
  canvas.Arrow({s.left, y}, {s.left + length, y}, kLine);
  canvas.Line({s.left, y - 1.5}, {s.left, y + 1.5}, kLine);
  canvas.Text({s.left + length + 1.2, y + 0.9}, "x", kText);
  canvas.Arrow({x, s.top}, {x, s.top + length}, kLine);
  canvas.Line({x - 1.5, s.top}, {x + 1.5, s.top}, kLine);
  canvas.Text({x, s.top + length + 3}, "y", kText, TextAlign::kMiddle);
}

// Lengths over all corners, below and at the right.
void DrawMeasures(Canvas& canvas, const Piece& piece, double away) {
  const PageBox& s = piece.square;
  const double y = piece.print.bottom() + away;
  const double x = piece.print.right() + away;
  const std::string wide = Mm(s.width);
  const std::string high = Mm(s.height);
  const double text_wide = canvas.TextWidth(wide, kText) / 2 + 1;
  const double text_high = canvas.TextWidth(high, kText) / 2 + 1;
  const PagePoint middle{s.left + s.width / 2, s.top + s.height / 2};
  canvas.Arrow({middle.x - text_wide, y}, {s.left, y}, kHair);
  canvas.Arrow({middle.x + text_wide, y}, {s.right(), y}, kHair);
  canvas.Text({middle.x, y + 1}, wide, kText, TextAlign::kMiddle);
  canvas.Arrow({x, middle.y + text_high}, {x, s.bottom()}, kHair);
  canvas.Arrow({x, middle.y - text_high}, {x, s.top}, kHair);
  canvas.TextUpwards({x + 1, middle.y}, high, kText, TextAlign::kMiddle);
  for (const double end : {s.left, s.right()}) canvas.Line({end, y - 1.5}, {end, y + 1.5}, kHair);
  for (const double end : {s.top, s.bottom()}) canvas.Line({x - 1.5, end}, {x + 1.5, end}, kHair);
}

// The tags' ids, faint, in the gaps below them.
void DrawIds(Canvas& canvas, const Piece& piece) {
  const Board& board = piece.placed.board;
  if (piece.d.kind != BoardKind::kTags || piece.d.family == kKalibrFamily) return;
  const double gap = 1000 * piece.d.gap - 2 * piece.rim;
  const double height = std::min(kSmallText, 0.5 * gap);
  if (board.tags() > 1 && height < 1) return;  // too small to read
  canvas.SetGrey(kFaint);
  for (int id = piece.d.first_id; board.HasTag(id); ++id) {
    const MarkCorners corners = board.CornersOf(id);
    const double x = piece.square.left + 500 * (corners[0].x() + corners[1].x());
    const double y = piece.square.top + 1000 * corners[0].y() + piece.rim + std::min(gap, 4.0) / 2;
    canvas.Text({x, y + 0.36 * height}, absl::StrCat(id), height, TextAlign::kMiddle);
  }
  canvas.SetGrey(kInk);
}

// Short lines in the band that lengthen the sides of a single tag's square, for surveying, and the
// numbers of its corners.
void DrawCorners(Canvas& canvas, const Piece& piece) {
  const PageBox& s = piece.square;
  const PageBox& p = piece.print;
  constexpr double kFrom = 1;
  constexpr double kTo = 4;
  for (const double x : {s.left, s.right()}) {
    canvas.Line({x, p.top - kFrom}, {x, p.top - kTo}, kHair);
    canvas.Line({x, p.bottom() + kFrom}, {x, p.bottom() + kTo}, kHair);
  }
  for (const double y : {s.top, s.bottom()}) {
    canvas.Line({p.left - kFrom, y}, {p.left - kTo, y}, kHair);
    canvas.Line({p.right() + kFrom, y}, {p.right() + kTo, y}, kHair);
  }
  canvas.SetGrey(kFaint);
  canvas.Text({p.left - 1.5, p.bottom() + 3}, "0", kSmallText, TextAlign::kRight);
  canvas.Text({p.right() + 1.5, p.bottom() + 3}, "1", kSmallText);
  canvas.Text({p.right() + 1.5, p.top - 1.5}, "2", kSmallText);
  canvas.Text({p.left - 1.5, p.top - 1.5}, "3", kSmallText, TextAlign::kRight);
  canvas.SetGrey(kInk);
}

// A frame in the tag's middle: x to the right, y up, z towards the reader.
void DrawFlangeFrame(Canvas& canvas, const Piece& piece) {
  const PageBox& p = piece.print;
  const PagePoint middle{p.left + p.width / 2, p.top + p.height / 2};
  constexpr double kFrom = 1.5;
  constexpr double kTo = 11;
  canvas.Arrow({p.right() + kFrom, middle.y}, {p.right() + kTo, middle.y}, kLine);
  canvas.Text({p.right() + kTo + 1, middle.y + 1}, "x", kText + 0.6);
  canvas.Arrow({middle.x, p.top - kFrom}, {middle.x, p.top - kTo}, kLine);
  canvas.Text({middle.x, p.top - kTo - 1.5}, "y", kText + 0.6, TextAlign::kMiddle);
  canvas.Line({p.left - kFrom, middle.y}, {p.left - kTo, middle.y}, kHair);
  canvas.Line({middle.x, p.bottom() + kFrom}, {middle.x, p.bottom() + kTo}, kHair);
  const PagePoint z{p.right() + 8, p.top - 8};
  canvas.Circle(z, 2, kLine);
  canvas.Disc(z, 0.6);
  canvas.Text({z.x + 3, z.y + 1}, "z", kText + 0.6);
}

std::string Ids(const Piece& piece) {
  const int first = piece.d.first_id;
  const int last = first + piece.placed.board.tags() - 1;
  return first == last ? absl::StrCat("id ", first) : absl::StrCat("ids ", first, "-", last);
}

// Two lines that say what the board is.
std::pair<std::string, std::string> CaptionOf(const Piece& piece) {
  const BoardDescription& d = piece.d;
  const std::string name = d.name + ":  ";
  const std::string size = absl::StrCat(d.columns, " x ", d.rows);
  const std::string square = absl::StrCat("square ", Plain(piece.side), " mm");
  switch (d.kind) {
    case BoardKind::kTags: {
      const std::string tag = absl::StrCat("tag_size ", Plain(piece.side), " mm");
      const std::string tags = absl::StrCat(name, d.family, "  ", Ids(piece));
      if (piece.placed.board.tags() == 1) return {tags, tag};
      return {
          absl::StrCat(tags, "  ", d.rows, " rows x ", d.columns, " columns"),
          absl::StrCat(tag, ", gap ", Plain(1000 * d.gap), " mm, measured from corner to corner")};
    }
    case BoardKind::kChessboard:
      return {absl::StrCat(name, "chessboard of ", size, " inner corners (columns x rows)"),
              square};
    case BoardKind::kCharuco:
      return {absl::StrCat(name, "ChArUco board of ", size, " squares (columns x rows), ",
                           d.dictionary, " from id ", d.first_id),
              absl::StrCat(square, ", marker ", Plain(1000 * d.tag_size), " mm")};
    case BoardKind::kCircles:
      return {absl::StrCat(name, d.asymmetric ? "asymmetric board of " : "board of ", size,
                           " circles (columns x rows)"),
              absl::StrCat("spacing ", Plain(piece.side), " mm, from a row to the next")};
  }
  return {};
}

void DrawCaption(Canvas& canvas, const Piece& piece, SheetKind kind) {
  const PageBox& outline = piece.placed.outline;
  const double top = outline.bottom() - MeasuresOf(kind).caption;
  const double left = std::max(outline.left + 2, piece.square.left - piece.rim);
  const double most = outline.right() - 2 - left;
  auto [first, second] = CaptionOf(piece);
  if (kind == SheetKind::kFlangeTag) {
    absl::StrAppend(&second, "; flange frame in its middle, z out of the paper");
  }
  if (kind == SheetKind::kFloorTag) absl::StrAppend(&second, "; corners 0 to 3 of the square");
  canvas.Text({left, top + 2.6}, first, kText + 0.4, TextAlign::kLeft, most);
  canvas.Text({left, top + 6.4}, second, kText - 0.2, TextAlign::kLeft, most);
}

void DrawPiece(Canvas& canvas, const PlacedBoard& placed, SheetKind kind) {
  const Piece piece(placed);
  DrawPrint(canvas, piece);
  DrawCutMarks(canvas, placed.outline);
  DrawCaption(canvas, piece, kind);
  switch (kind) {
    case SheetKind::kBoard:
      DrawAxes(canvas, piece, 4);
      DrawMeasures(canvas, piece, 5.5);
      DrawIds(canvas, piece);
      break;
    case SheetKind::kFlangeTag:
      DrawFlangeFrame(canvas, piece);
      break;
    case SheetKind::kFloorTag:
      DrawCorners(canvas, piece);
      DrawAxes(canvas, piece, 6.5);
      break;
  }
}

// How corners are found on the paper with a rule.
std::string HowToMeasure(const Piece& piece, SheetKind kind) {
  if (piece.d.kind != BoardKind::kTags) {
    return absl::StrCat("The board's frame: origin at the first ",
                        piece.d.kind == BoardKind::kCircles ? "circle's middle" : "inner corner",
                        " (top left), x right, y down, z into the paper.");
  }
  const bool ring = TagFamily(piece.d.family).reversed_border();
  std::string text = absl::StrCat("A tag's corners: of ",
                                  ring ? "the white ring in its middle, along the ring's outer edge"
                                       : "the black square, along its outer edge");
  if (kind == SheetKind::kFlangeTag) {
    return absl::StrCat(text,
                        ". Glued with its middle on the flange's axis, a point x y z of the "
                        "board, in mm, is at ",
                        Plain(-piece.side / 2), " + x, ", Plain(piece.side / 2),
                        " - y, t - z of the flange (t: thickness).");
  }
  const int first = piece.d.first_id;
  const int top = piece.d.from_bottom ? first + (piece.d.rows - 1) * piece.d.columns : first;
  const std::string corner = kind == SheetKind::kBoard
                                 ? absl::StrCat("the top left corner of tag ", top)
                                 : "the tag's top left corner (3)";
  return absl::StrCat(text, ". The board's frame: origin at ", corner,
                      ", x right, y down, z into the paper.");
}

void DrawFooter(Canvas& canvas, const BoardSheet& sheet) {
  const Paper& paper = sheet.paper;
  const double left = kPageMargin;
  const double top = paper.height - kUnprintable - kFooter;
  const double most = paper.width - 2 * kPageMargin;
  const double bar = most >= 170 ? 100 : most >= 85 ? 50 : 20;
  const double y = top + 3.5;
  canvas.Line({left, y}, {left + bar, y}, kLine);
  for (int mm = 0; mm <= bar; mm += 10) {
    const double half = mm == 0 || mm == bar ? 2.5 : 1;
    canvas.Line({left + mm, y - half}, {left + mm, y + half}, mm == 0 || mm == bar ? kHair : kLine);
  }
  canvas.Text({left + bar + 3, y + 1},
              absl::StrCat("This line is ", bar,
                           " mm long if printed at 100 % (never \"fit to "
                           "page\")."),
              kText, TextAlign::kLeft, most - bar - 3);
  const std::string notes[] = {
      absl::StrCat("If it measures L mm, multiply the lengths in the board's file by L / ", bar,
                   ". Glue the print flat onto a stiff, matt plate; cut at the marks."),
      HowToMeasure(Piece(sheet.boards.front()), sheet.kind)};
  double line = y + 6.5;
  for (const std::string& note : notes) {
    canvas.Text({left, line}, note, kText - 0.2, TextAlign::kLeft, most);
    line += 4;
  }
}

}  // namespace

Page PageOf(const BoardSheet& sheet) {
  return {sheet.paper, [sheet](Canvas& canvas) {
            for (const PlacedBoard& board : sheet.boards) DrawPiece(canvas, board, sheet.kind);
            DrawFooter(canvas, sheet);
          }};
}

}  // namespace silhouette
