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
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/commands.h"

namespace silhouette {
namespace {

constexpr double kMmPerMetre = 1000;

struct BoardArguments {
  std::string name;  // empty: as `out`
  std::string family = "tagStandard41h12";
  int rows = 4;
  int columns = 6;
  double tag_size = 0;  // mm; 0: as the kind of sheet wants it
  double gap = 0;       // mm; 0: DefaultGap
  int first_id = 0;
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

// Metres, without the last bits' noise of a division: 30 mm are 0.03.
double Metres(double mm) { return std::round(mm * 1e6) / 1e6 / kMmPerMetre; }

std::vector<Board> BoardsFor(const BoardArguments& a) {
  const double tag_size = a.tag_size > 0 ? a.tag_size : DefaultTagSize(a.kind());
  BoardDescription d{
      .name = a.name.empty() ? std::filesystem::path(a.out).filename().string() : a.name,
      .family = a.family,
      .tag_size = Metres(tag_size),
      .first_id = a.first_id};
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

void Print(const BoardArguments& arguments, const std::vector<Board>& boards,
           const std::vector<BoardSheet>& sheets, const std::vector<std::string>& files) {
  const Paper& paper = sheets.front().paper;
  const BoardDescription& first = boards.front().description();
  const int last = boards.back().description().first_id + boards.back().tags() - 1;
  PrintResult(
      arguments.format,
      {{"boards", boards.size()},
       {"family", first.family},
       {"first_id", first.first_id},
       {"last_id", last},
       {"tag_size", first.tag_size},
       {"gap", first.gap},
       {"paper", paper.name},
       {"pages", sheets.size()},
       {"lattice", boards.front().IsLattice()},
       {"files", files}},
      absl::StrCat(
          first.family, " ", first.first_id, " to ", last, ", tags of ",
          first.tag_size * kMmPerMetre, " mm, on ", sheets.size(),
          sheets.size() == 1 ? " page " : " pages ", paper.name, "; wrote ",
          absl::StrJoin(files, ", "), "\nPrint the PDF at 100 % and measure its line; correct the ",
          "lengths in ", files.front(), " if it differs.\n",
          boards.front().IsLattice()
              ? ""
              : "Its corners are no regular lattice: the lens takes longer to solve from it.\n"));
}

absl::StatusOr<ExitCode> RunBoard(const BoardArguments& arguments) {
  const std::vector<Board> boards = BoardsFor(arguments);
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
      "board", "Make a board of AprilTags to be printed: PDF, PNG and its description");
  auto a = std::make_shared<BoardArguments>();
  command->add_option("--out", a->out, "Writes OUT.pdf, OUT.png and OUT.yaml")->required();
  command->add_option("--name", a->name, "Name of the board; default: the last part of OUT");
  command->add_option("--family", a->family, "Tag family")->capture_default_str();
  auto* rows = command->add_option("--rows", a->rows, "Rows of tags")->capture_default_str();
  auto* columns =
      command->add_option("--columns", a->columns, "Columns of tags")->capture_default_str();
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
  command->add_option("--first-id", a->first_id, "Id of the first tag")->capture_default_str();
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
      "  silhouette-calibrate board --out flange --flange --first-id 100\n"
      "  silhouette-calibrate board --out floor --floor 6 --first-id 200 --paper A4");
  command->callback([a, &run] { run = [a] { return RunBoard(*a); }; });
}

}  // namespace silhouette
