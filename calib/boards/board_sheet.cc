// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/board_sheet.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <regex>
#include <stdexcept>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/boards/board.h"
#include "calib/boards/board_print.h"
#include "calib/boards/canvas.h"

namespace silhouette {
namespace {

struct Size {
  const char* name;
  double width;
  double height;
};

constexpr Size kSizes[] = {{"A4", 210, 297},         {"A3", 297, 420},         {"A2", 420, 594},
                           {"A1", 594, 841},         {"A0", 841, 1189},        {"A5", 148, 210},
                           {"Letter", 215.9, 279.4}, {"Tabloid", 279.4, 431.8}};
constexpr size_t kAutomatic = 5;  // the first of kSizes
constexpr double kLeast = 50;     // mm, of a side
constexpr double kMost = 5000;

Paper Portrait(const Size& size) { return {size.name, size.width, size.height}; }
Paper Landscape(const Size& size) {
  return {absl::StrCat(size.name, " landscape"), size.height, size.width};
}

}  // namespace

std::vector<Paper> PapersFromText(const std::string& text) {
  static const std::regex sides(R"(\s*([0-9.]+)\s*[xX]\s*([0-9.]+)\s*(mm)?\s*)");
  std::smatch match;
  if (std::regex_match(text, match, sides)) {
    Paper paper;
    if (absl::SimpleAtod(match[1].str(), &paper.width) &&
        absl::SimpleAtod(match[2].str(), &paper.height) && paper.width >= kLeast &&
        paper.height >= kLeast && paper.width <= kMost && paper.height <= kMost) {
      paper.name = absl::StrCat(paper.width, "x", paper.height, " mm");
      return {paper};
    }
    throw std::invalid_argument(
        absl::StrCat("paper '", text, "': sides are in mm, from ", kLeast, " to ", kMost));
  }
  const std::string lower = absl::AsciiStrToLower(text);
  for (const Size& size : kSizes) {
    const std::string name = absl::AsciiStrToLower(size.name);
    if (lower == name) return {Portrait(size), Landscape(size)};
    if (lower == name + " portrait") return {Portrait(size)};
    if (lower == name + " landscape") return {Landscape(size)};
  }
  throw std::invalid_argument(absl::StrCat(
      "there is no paper '", text,
      "'; papers are A5, A4, A3, A2, A1, A0, Letter, Tabloid, each also with 'portrait' or "
      "'landscape' behind it, or width x height in mm, e.g. 600x400"));
}

std::vector<Paper> AutomaticPapers() {
  std::vector<Paper> papers;
  for (size_t i = 0; i < kAutomatic; ++i) {
    papers.push_back(Portrait(kSizes[i]));
    papers.push_back(Landscape(kSizes[i]));
  }
  return papers;
}

namespace {

constexpr double kMmPerMetre = 1000;
constexpr double kLeastTag = 3;  // mm; a smaller one is not worth proposing

struct Extent {
  double width = 0;
  double height = 0;
};

// The print, with `scale` applied.
Extent PrintExtent(const Board& board, double scale = 1) {
  const Eigen::Vector2d size =
      scale * kMmPerMetre * (board.extent() + Eigen::Vector2d::Constant(2 * PrintRim(board)));
  return {size.x(), size.y()};
}

Extent OutlineExtent(const Board& board, SheetKind kind, double scale = 1) {
  const SheetMeasures measures = MeasuresOf(kind);
  const Extent print = PrintExtent(board, scale);
  return {print.width + 2 * measures.band, print.height + 2 * measures.band + measures.caption};
}

// How many pieces of `outline` stand side by side in `room`.
int Pieces(double outline, double room) {
  return std::max(0, static_cast<int>((room + kBetweenPieces + 1e-9) / (outline + kBetweenPieces)));
}

Extent Room(const Paper& paper) {
  return {paper.width - 2 * kPageMargin, paper.height - 2 * kPageMargin - kFooter};
}

int PiecesOn(const Paper& paper, const Extent& outline) {
  return Pieces(outline.width, Room(paper).width) * Pieces(outline.height, Room(paper).height);
}

std::optional<Paper> FirstFitting(const std::vector<Paper>& papers, const Extent& outline,
                                  int pieces) {
  for (const Paper& paper : papers) {
    if (PiecesOn(paper, outline) >= pieces) return paper;
  }
  return std::nullopt;
}

std::string WithDigits(double mm) { return absl::StrFormat("%.0f", std::ceil(mm)); }

// Why the board does not fit, and what would.
[[noreturn]] void RefuseSize(const Board& board, SheetKind kind, int per_page,
                             const std::vector<Paper>& papers) {
  const BoardDescription& d = board.description();
  const bool tags = d.kind == BoardKind::kTags;
  const bool circles = d.kind == BoardKind::kCircles;
  const double side = kMmPerMetre * (tags ? d.tag_size : d.square);
  std::string what = absl::StrCat(d.rows, " x ", d.columns, " tags of ");
  if (!tags) {
    what = absl::StrCat(d.columns, "x", d.rows,
                        circles                            ? " circles, spacing "
                        : d.kind == BoardKind::kChessboard ? " corners, squares of "
                                                           : " squares of ");
  }
  const Extent outline = OutlineExtent(board, kind);
  const Paper& largest = papers.back();
  std::string message =
      absl::StrCat("board '", d.name, "' (", what, side, " mm) needs ", WithDigits(outline.width),
                   " x ", WithDigits(outline.height), " mm",
                   per_page > 1 ? absl::StrCat(" for each of ", per_page, " a page") : "", ", but ",
                   largest.name, " has room for ", std::floor(Room(largest).width), " x ",
                   std::floor(Room(largest).height), " mm beside margins and notes; take ");
  if (const std::optional<Paper> paper = FirstFitting(AutomaticPapers(), outline, per_page)) {
    absl::StrAppend(&message, "--paper '", paper->name, "', ");
  }
  double fitting = 0;  // the largest, in steps of half a millimetre
  for (double size = 0.5; size < side; size += 0.5) {
    const Extent smaller = OutlineExtent(board, kind, size / side);
    if (FirstFitting(papers, smaller, per_page)) fitting = size;
  }
  if (fitting >= kLeastTag) {
    absl::StrAppend(&message,
                    tags      ? "--tag-size "
                    : circles ? "--spacing "
                              : "--square ",
                    fitting, d.gap > 0 ? " (the gap in proportion)" : "", " or less, ");
  }
  absl::StrAppend(&message, "or ", per_page > 1 ? "fewer tags a page" : "fewer rows and columns");
  throw std::invalid_argument(message);
}

void RequireSingleTags(const std::vector<Board>& boards, SheetKind kind) {
  if (boards.empty()) throw std::invalid_argument("there is no board to be printed");
  if (kind == SheetKind::kBoard) return;
  for (const Board& board : boards) {
    if (board.tags() != 1) {
      throw std::invalid_argument("board '" + board.description().name +
                                  "' has several tags; flange and floor tags are single ones");
    }
  }
}

PlacedBoard Place(const Board& board, SheetKind kind, PagePoint corner) {
  const Extent outline = OutlineExtent(board, kind);
  const double inset = MeasuresOf(kind).band + kMmPerMetre * PrintRim(board);
  return {board,
          {corner.x + inset, corner.y + inset},
          {corner.x, corner.y, outline.width, outline.height}};
}

}  // namespace

std::vector<BoardSheet> LayOutSheets(const std::vector<Board>& boards, SheetKind kind, int per_page,
                                     const std::vector<Paper>& papers) {
  RequireSingleTags(boards, kind);
  if (const absl::Status status = CheckBoards(boards); !status.ok()) {
    throw std::invalid_argument(std::string(status.message()));
  }
  if (per_page < 1) throw std::invalid_argument("there must be at least one tag a page");
  if (papers.empty()) throw std::invalid_argument("there is no paper");
  Extent outline;
  for (const Board& board : boards) {
    const Extent one = OutlineExtent(board, kind);
    outline = {std::max(outline.width, one.width), std::max(outline.height, one.height)};
  }
  per_page = std::min(per_page, static_cast<int>(boards.size()));
  const std::optional<Paper> paper = FirstFitting(papers, outline, per_page);
  if (!paper) RefuseSize(boards.front(), kind, per_page, papers);

  const int columns = std::min(Pieces(outline.width, Room(*paper).width), per_page);
  const double width = columns * (outline.width + kBetweenPieces) - kBetweenPieces;
  const double left = (paper->width - width) / 2;
  std::vector<BoardSheet> sheets;
  for (size_t i = 0; i < boards.size(); ++i) {
    const int place = static_cast<int>(i) % per_page;
    if (place == 0) sheets.push_back({kind, *paper, {}});
    const PagePoint corner{left + (place % columns) * (outline.width + kBetweenPieces),
                           kPageMargin + (place / columns) * (outline.height + kBetweenPieces)};
    sheets.back().boards.push_back(Place(boards[i], kind, corner));
  }
  return sheets;
}

}  // namespace silhouette
