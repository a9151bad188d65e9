// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate board
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/boards/board.h"
#include "calib/boards/board_sheet.h"
#include "calib/boards/tag_family.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/lengths.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"

namespace silhouette {
namespace {

constexpr double kMmPerMetre = 1000;

struct BoardArguments {
  std::string from;  // file of boards; empty: made by the rest
  std::string name;  // empty: as `out`
  std::string family = "tagStandard41h12";
  int rows = 4;
  int columns = 6;
  double tag_size = 0;  // mm; 0: as the kind of sheet wants it
  double gap = 0;       // mm; 0: DefaultGap
  int first_id = 0;
  std::string chessboard;  // columns x rows; empty: none
  std::string charuco;     // the same
  std::string circles;     // the same
  double spacing = 0;      // mm; 0: kDefaultSpacing
  bool asymmetric = false;
  double square = 0;  // mm; 0: DefaultSquare
  double marker = 0;  // mm; 0: a share of the square
  std::string dictionary = "DICT_4X4_50";
  bool legacy = false;
  bool flange = false;
  int floor = 0;
  int per_page = 1;
  std::string paper;
  double dpi = 150;
  std::string out;
  bool overwrite = false;
  std::string format = "text";

  SheetKind kind() const {
    if (flange) return SheetKind::kFlangeTag;
    return floor > 0 ? SheetKind::kFloorTag : SheetKind::kBoard;
  }
};

double DefaultTagSize(SheetKind kind) {
  if (kind == SheetKind::kFlangeTag) return 40;
  return kind == SheetKind::kFloorTag ? 100 : 30;
}

// Millimetres between corners: as much as a tag, so that all corners are one lattice, or where a
// family's prints are too wide for that, a module between the prints.
double DefaultGap(const std::string& family_name, double tag_size) {
  const TagFamily family(family_name);
  const double module = tag_size / family.width_at_border();
  return std::max(tag_size, (family.total_width() - family.width_at_border() + 1) * module);
}

constexpr double kDefaultSquare = 25;   // mm
constexpr double kDefaultSpacing = 20;  // mm
constexpr double kMarkerOfSquare = 0.75;

// Metres, without the last bits' noise of a division: 30 mm are 0.03.
double Metres(double mm) { return std::round(mm * 1e6) / 1e6 / kMmPerMetre; }

std::string NameOf(const BoardArguments& a) {
  return a.name.empty() ? std::filesystem::path(a.out).filename().string() : a.name;
}

// A chessboard, ChArUco board or circles.
BoardDescription SquaresFor(const BoardArguments& a) {
  const double square = a.square > 0 ? a.square : kDefaultSquare;
  BoardDescription d{.name = NameOf(a), .kind = BoardKind::kChessboard, .square = Metres(square)};
  if (!a.circles.empty()) {
    d.kind = BoardKind::kCircles;
    d.square = Metres(a.spacing > 0 ? a.spacing : kDefaultSpacing);
    d.asymmetric = a.asymmetric;
  }
  if (!a.charuco.empty()) {
    d.kind = BoardKind::kCharuco;
    d.dictionary = a.dictionary;
    d.tag_size = Metres(a.marker > 0 ? a.marker : kMarkerOfSquare * square);
    d.first_id = a.first_id;
    d.legacy = a.legacy;
  }
  const auto size = GridSizeFromText(a.chessboard + a.charuco + a.circles);
  if (!size) {
    throw std::invalid_argument("--chessboard, --charuco and --circles are columns x rows, as 9x6");
  }
  d.columns = size->columns;
  d.rows = size->rows;
  return d;
}

// Throws if a side was meant in metres: no print shows so small a one.
void RequirePrintable(const BoardArguments& a) {
  for (const auto& [option, side] : {std::pair{"--tag-size", a.tag_size},
                                     {"--square", a.square},
                                     {"--marker", a.marker},
                                     {"--spacing", a.spacing}}) {
    if (side > 0 && side < 1) {
      throw std::invalid_argument(absl::StrCat(option, ": ", side,
                                               " mm is too small to print; numbers are "
                                               "millimetres: for metres write ",
                                               side, "m"));
    }
  }
}

std::vector<Board> BoardsFor(const BoardArguments& a) {
  RequirePrintable(a);
  if (!a.chessboard.empty() || !a.charuco.empty() || !a.circles.empty()) {
    return {Board(SquaresFor(a))};
  }
  const double tag_size = a.tag_size > 0 ? a.tag_size : DefaultTagSize(a.kind());
  BoardDescription d{
      .name = NameOf(a), .family = a.family, .tag_size = Metres(tag_size), .first_id = a.first_id};
  if (a.kind() == SheetKind::kBoard) {
    d.rows = a.rows;
    d.columns = a.columns;
    if (a.rows * a.columns > 1) d.gap = Metres(a.gap > 0 ? a.gap : DefaultGap(a.family, tag_size));
  }
  if (a.kind() != SheetKind::kFloorTag) return {Board(d)};
  std::vector<Board> boards;
  const std::string name = d.name;
  for (int i = 0; i < a.floor; ++i) {
    d.first_id = a.first_id + i;
    d.name = absl::StrCat(name, "-", d.first_id);
    boards.push_back(Board(d));
  }
  return boards;
}

// The files to be written and what is in them; the YAML first.
std::vector<std::pair<std::string, std::string>> Files(const BoardArguments& arguments,
                                                       const std::vector<Board>& boards,
                                                       const std::vector<BoardSheet>& sheets) {
  std::vector<Page> pages;
  for (const BoardSheet& sheet : sheets) pages.push_back(PageOf(sheet));
  std::vector<std::pair<std::string, std::string>> files = {
      {arguments.out + ".yaml", BoardFileText(boards)}, {arguments.out + ".pdf", PdfOf(pages)}};
  for (size_t i = 0; arguments.dpi > 0 && i < pages.size(); ++i) {
    const std::string number = pages.size() > 1 ? absl::StrCat("-", i + 1) : "";
    files.emplace_back(arguments.out + number + ".png", PngOf(pages[i], arguments.dpi));
  }
  return files;
}

// "chessboard-9x6, squares of 25 mm".
std::string WhatIs(const std::vector<Board>& boards) {
  const Board& first = boards.front();
  const BoardDescription& d = first.description();
  if (d.kind != BoardKind::kTags) {
    return absl::StrCat(first.family(),
                        d.kind == BoardKind::kCircles ? ", spacing " : ", squares of ",
                        d.square * kMmPerMetre, " mm");
  }
  const int last = boards.back().first_mark() + boards.back().tags() - 1;
  return absl::StrCat(d.family, " ", d.first_id, " to ", last, ", tags of ",
                      d.tag_size * kMmPerMetre, " mm");
}

void Print(const BoardArguments& arguments, const std::vector<Board>& boards,
           const std::vector<BoardSheet>& sheets, const std::vector<std::string>& files) {
  const Paper& paper = sheets.front().paper;
  const Board& first = boards.front();
  const BoardDescription& d = first.description();
  nlohmann::ordered_json json = {
      {"boards", boards.size()},
      {"family", first.family()},
      {"first_id", first.first_mark()},
      {"last_id", boards.back().first_mark() + boards.back().tags() - 1},
      {"paper", paper.name},
      {"pages", sheets.size()},
      {"lattice", first.lattice().value_or(Lattice{.exact = false}).exact},
      {"files", files}};
  if (d.tag_size > 0) json["tag_size"] = d.tag_size;
  switch (d.kind) {
    case BoardKind::kTags:
      json["gap"] = d.gap;
      break;
    case BoardKind::kCircles:
      json["spacing"] = d.square;
      break;
    default:
      json["square"] = d.square;
  }
  std::string notes;
  if (!first.lattice()) {
    notes = "It has too many tags, or too wide a gap, for the lattice that `intrinsics` needs.\n";
  } else if (first.IsAmbiguous()) {
    notes = "It looks the same turned by half: good for lenses, not for poses.\n";
  }
  PrintResult(arguments.format, json,
              absl::StrCat(WhatIs(boards), ", on ", sheets.size(),
                           sheets.size() == 1 ? " page " : " pages ", paper.name, "; wrote ",
                           absl::StrJoin(files, ", "),
                           "\nPrint the PDF at 100 % and measure its line; correct the lengths in ",
                           files.front(), " if it differs.\n", notes));
}

absl::StatusOr<ExitCode> RunBoard(const BoardArguments& arguments) {
  std::vector<Board> boards;
  if (arguments.from.empty()) {
    boards = BoardsFor(arguments);
  } else {
    ASSIGN_OR_RETURN(boards, ReadBoards(arguments.from));
  }
  const std::vector<Paper> papers =
      arguments.paper.empty() ? AutomaticPapers() : PapersFromText(arguments.paper);
  const std::vector<BoardSheet> sheets =
      LayOutSheets(boards, arguments.kind(), arguments.per_page, papers);
  const std::string yaml = arguments.out + ".yaml";
  if (!arguments.overwrite && std::filesystem::exists(yaml)) {
    throw std::invalid_argument("'" + yaml +
                                "' is there already, perhaps with what you measured; "
                                "take another --out, or --overwrite");
  }
  std::vector<std::string> written;
  for (const auto& [file, bytes] : Files(arguments, boards, sheets)) {
    RETURN_IF_ERROR(WriteWholeFile(file, bytes));
    written.push_back(file);
  }
  Print(arguments, boards, sheets, written);
  return kDone;
}

}  // namespace

void AddBoardCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "board",
      "Make a board to be printed, of AprilTags, a chessboard, ChArUco or circles: PDF, PNG and "
      "its description");
  auto a = std::make_shared<BoardArguments>();
  command->add_option("--out", a->out, "Writes OUT.pdf, OUT.png and OUT.yaml")->required();
  command->add_option("--name", a->name, "Name of the board; default: the last part of OUT");
  auto* family = command->add_option("--family", a->family, "Tag family")->capture_default_str();
  auto* rows = command->add_option("--rows", a->rows, "Rows of tags")->capture_default_str();
  auto* columns =
      command->add_option("--columns", a->columns, "Columns of tags")->capture_default_str();
  auto* tag_size =
      command
          ->add_option("--tag-size", a->tag_size,
                       "Millimetres from corner to corner of a tag (30; flange 40; floor 100)")
          ->check(PositiveNumber());
  auto* gap =
      command
          ->add_option("--gap", a->gap,
                       "Millimetres between the corners of neighbours; default: the tag size, so "
                       "that all corners form one lattice")
          ->check(PositiveNumber());
  for (auto* length : {tag_size, gap}) TakeLengths(length, LengthUnit::kMillimetres);
  auto* first_id = command->add_option("--first-id", a->first_id, "Id of the first tag or marker")
                       ->capture_default_str();
  auto* flange = command->add_flag("--flange", a->flange,
                                   "One tag for the robot's flange, with the flange's frame");
  auto* floor = command
                    ->add_option("--floor", a->floor,
                                 "Number of single tags for floor and walls, with their axes")
                    ->check(CLI::Range(1, 10000));
  command->add_option("--per-page", a->per_page, "Floor tags on a page")
      ->needs(floor)
      ->capture_default_str();
  flange->excludes(floor);
  for (auto* single : {flange, floor}) single->excludes(rows)->excludes(columns)->excludes(gap);
  auto* chessboard = command->add_option(
      "--chessboard", a->chessboard, "A chessboard instead: inner corners, columns x rows, as 9x6");
  auto* charuco = command->add_option("--charuco", a->charuco,
                                      "A ChArUco board instead: squares, columns x rows, as 7x5");
  auto* circles =
      command->add_option("--circles", a->circles, "Circles instead: columns x rows, as 4x11");
  auto* spacing =
      command->add_option("--spacing", a->spacing, "Millimetres from a row to the next (20)")
          ->needs(circles)
          ->check(PositiveNumber());
  auto* asymmetric =
      command->add_flag("--asymmetric", a->asymmetric, "Every second row is moved by a spacing")
          ->needs(circles);
  auto* square = command->add_option("--square", a->square, "Millimetres of a square's side (25)")
                     ->check(PositiveNumber());
  auto* marker =
      command->add_option("--marker", a->marker, "Millimetres of a marker's side (0.75 squares)")
          ->needs(charuco)
          ->check(PositiveNumber());
  for (auto* length : {square, marker, spacing}) TakeLengths(length, LengthUnit::kMillimetres);
  auto* dictionary =
      command->add_option("--dictionary", a->dictionary, "Of the markers, by OpenCV's name")
          ->needs(charuco)
          ->capture_default_str();
  auto* legacy =
      command->add_flag("--legacy", a->legacy, "Laid out as by OpenCV before 4.6")->needs(charuco);
  for (auto* squares : {chessboard, charuco, circles}) {
    for (auto* of_tags : {family, rows, columns, tag_size, gap, flange, floor}) {
      squares->excludes(of_tags);
    }
  }
  chessboard->excludes(charuco)->excludes(first_id);
  circles->excludes(chessboard)->excludes(charuco)->excludes(first_id)->excludes(square);
  auto* from = command->add_option(
      "--from", a->from, "Print the boards of this file instead (YAML, ours or Kalibr's)");
  for (auto* made : {family, rows, columns, tag_size, gap, first_id, flange, floor, chessboard,
                     charuco, square, marker, dictionary, legacy, circles, spacing, asymmetric}) {
    from->excludes(made);
  }
  command->add_option("--paper", a->paper,
                      "A5 to A0, Letter, Tabloid, or width x height in mm, e.g. 600x400; default: "
                      "the smallest of A4 to A0 that fits");
  command->add_option("--dpi", a->dpi, "Resolution of the PNG; 0: no PNG")
      ->check(CLI::Range(0, 2400))
      ->capture_default_str();
  command->add_flag("--overwrite", a->overwrite, "Replace existing files");
  AddFormatOption(*command, a->format);
  command->footer(
      "Examples:\n"
      "  silhouette-calibrate board --out wall --rows 4 --columns 6 --tag-size 30\n"
      "  silhouette-calibrate board --out hand --chessboard 9x6 --square 25\n"
      "  silhouette-calibrate board --out plate --charuco 7x5 --square 40 --marker 30\n"
      "  silhouette-calibrate board --out dots --circles 4x11 --asymmetric --spacing 20\n"
      "  silhouette-calibrate board --out grid --from april_6x6.yaml\n"
      "  silhouette-calibrate board --out flange --flange --first-id 100\n"
      "  silhouette-calibrate board --out floor --floor 6 --first-id 200 --paper A4");
  command->callback([a, &run] { run = [a] { return RunBoard(*a); }; });
}

}  // namespace silhouette
