// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/board.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "calib/boards/charuco.h"
#include "calib/boards/csv.h"
#include "calib/boards/tag_family.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr int kMostTags = 1'000'000;
// Of a lattice: places along a tag, in all (mrcal holds them on the stack), and the pitch in tags.
constexpr int kMostPlacesPerTag = 20;
constexpr int kMostPlaces = 6400;
constexpr double kMostPitch = 10;
// By how much of itself a tag differs from its places on the lattice: what no print is truer than,
// what is near enough to want no finer lattice, and the most.
constexpr double kExactTag = 1e-4;
constexpr double kNearTag = 0.015;
constexpr double kMostMisfitOfTag = 0.1;
constexpr char kSymmetric[] = "-symmetric";

}  // namespace

std::optional<GridSize> GridSizeFromText(const std::string& text) {
  const std::vector<std::string> sides = absl::StrSplit(absl::AsciiStrToLower(text), 'x');
  GridSize size;
  if (sides.size() != 2 || !absl::SimpleAtoi(sides[0], &size.columns) ||
      !absl::SimpleAtoi(sides[1], &size.rows)) {
    return std::nullopt;
  }
  return size;
}

bool IsAmbiguousFamily(const std::string& family) { return family.ends_with(kSymmetric); }

Board::Board(BoardDescription description) : description_(std::move(description)) {
  const BoardDescription& d = description_;
  const auto require = [&](bool holds, const std::string& what) {
    if (!holds) throw std::invalid_argument("board '" + d.name + "': " + what);
  };
  const auto is_length = [](double length) { return std::isfinite(length) && length > 0; };
  require(!d.name.empty(), "a board needs a name");
  require(d.rows > 0 && d.columns > 0, "there must be at least one row and one column");
  require(d.rows <= kMostTags / d.columns, "there are too many rows and columns");
  require(d.first_id >= 0, "first_id must not be negative");
  require(d.first_id <= std::numeric_limits<int>::max() - kMostTags, "first_id is too large");
  const std::string size = absl::StrCat(d.columns, "x", d.rows);
  switch (d.kind) {
    case BoardKind::kTags:
      require(!d.family.empty(), "a board needs a tag family");
      require(is_length(d.tag_size), "tag_size must be positive");
      require(tags() == 1 || is_length(d.gap), "the gap between tags must be positive");
      family_ = d.family;
      break;
    case BoardKind::kChessboard:
      require(d.rows >= 3 && d.columns >= 3,
              "a chessboard needs at least 3x3 inner corners, in columns x rows");
      require(is_length(d.square), "square must be positive");
      family_ = absl::StrCat("chessboard-", size, (d.rows + d.columns) % 2 == 0 ? kSymmetric : "");
      break;
    case BoardKind::kCharuco:
      require(d.rows >= 3 && d.columns >= 3,
              "a ChArUco board needs at least 3x3 squares, in columns x rows");
      require(is_length(d.square), "square must be positive");
      require(is_length(d.tag_size) && d.tag_size < d.square,
              "marker must be positive and smaller than square");
      family_ = absl::StrCat("charuco-", d.dictionary, "-", d.first_id, "-", size);
      break;
    case BoardKind::kCircles:
      require(d.rows >= 2 && d.columns >= 2,
              "a board of circles needs at least 2x2 of them, in columns x rows");
      require(is_length(d.square), "spacing must be positive");
      family_ = absl::StrCat(d.asymmetric ? "asymmetric-circles-" : "circles-", size,
                             d.asymmetric && d.rows % 2 == 1 ? "" : kSymmetric);
      break;
  }
}

int Board::mark_rows() const {
  return description_.kind == BoardKind::kCharuco ? description_.rows - 1 : description_.rows;
}

int Board::mark_columns() const {
  return description_.kind == BoardKind::kCharuco ? description_.columns - 1 : description_.columns;
}

GridPlace Board::PlaceOf(int id) const {
  if (!HasTag(id)) {
    throw std::out_of_range("board '" + description_.name + "' has no tag " + std::to_string(id));
  }
  const int place = id - first_mark();
  const int row = place / mark_columns();
  return {.row = description_.from_bottom ? mark_rows() - 1 - row : row,
          .column = place % mark_columns()};
}

GridPlace Board::SquaresTo(GridPlace place) const {
  if (description_.asymmetric) place.column = 2 * place.column + place.row % 2;
  return place;
}

double NeighbourDistance(const BoardDescription& circles) {
  return (circles.asymmetric ? std::numbers::sqrt2 : 1) * circles.square;
}

GridPlace Board::MostSquares() const {
  const int across = (description_.asymmetric ? 2 : 1) * mark_columns() - 1;
  return {.row = mark_rows() - 1, .column = across};
}

MarkCorners Board::CornersOf(int id) const {
  const GridPlace place = PlaceOf(id);
  const BoardDescription& d = description_;
  if (d.kind != BoardKind::kTags) {
    const GridPlace squares = SquaresTo(place);
    return {{d.square * squares.column, d.square * squares.row, 0}};
  }
  const double pitch = d.tag_size + d.gap;
  const double left = pitch * place.column;
  const double top = pitch * place.row;
  const double right = left + d.tag_size;
  const double bottom = top + d.tag_size;
  return {{left, bottom, 0}, {right, bottom, 0}, {right, top, 0}, {left, top, 0}};
}

Eigen::Vector2d Board::extent() const {
  const BoardDescription& d = description_;
  if (d.kind != BoardKind::kTags) {
    return d.square * Eigen::Vector2d(MostSquares().column, MostSquares().row);
  }
  const Eigen::Vector2d steps(mark_columns() - 1, mark_rows() - 1);
  return (d.tag_size + d.gap) * steps + Eigen::Vector2d::Constant(d.tag_size);
}

Board::Steps Board::LatticeSteps() const {
  if (tags() == 1) return {.tag = 1, .pitch = 2};
  const double tag_size = description_.tag_size;
  const double pitch = tag_size + description_.gap;
  if (pitch > kMostPitch * tag_size) return {};
  Steps best;
  double least = kMostMisfitOfTag;
  for (int tag = 1; tag <= kMostPlacesPerTag; ++tag) {
    const Steps steps{.tag = tag, .pitch = static_cast<int>(std::lround(pitch / tag_size * tag))};
    if (steps.pitch <= tag) continue;
    const int64_t places = int64_t{Places(mark_columns(), steps)} * Places(mark_rows(), steps);
    if (places > kMostPlaces) break;
    const double misfit = std::abs(tag * pitch / steps.pitch - tag_size) / tag_size;
    if (misfit <= kExactTag) return steps;
    if (least <= kNearTag || misfit >= least) continue;
    best = steps;
    least = misfit;
  }
  return best;
}

int Board::Places(int marks, const Steps& steps) {
  return (marks - 1) * steps.pitch + steps.tag + 1;
}

std::optional<Lattice> Board::lattice() const {
  const BoardDescription& d = description_;
  Lattice lattice;
  if (d.kind != BoardKind::kTags) {
    const GridPlace most = MostSquares();
    lattice = {.width = most.column + 1, .height = most.row + 1, .spacing = d.square};
  } else {
    const Steps steps = LatticeSteps();
    if (steps.pitch == 0) return std::nullopt;
    lattice = {.width = Places(mark_columns(), steps),
               .height = Places(mark_rows(), steps),
               .spacing = d.tag_size};
    if (tags() > 1) {
      lattice.spacing = (d.tag_size + d.gap) / steps.pitch;
      lattice.exact = std::abs(steps.tag * lattice.spacing - d.tag_size) <= kExactTag * d.tag_size;
    }
  }
  if (lattice.width > kMostPlaces / lattice.height) return std::nullopt;
  return lattice;
}

GridPlace Board::LatticePlaceOf(int id, int corner) const {
  const GridPlace place = PlaceOf(id);
  if (description_.kind != BoardKind::kTags) return SquaresTo(place);
  const Steps steps = LatticeSteps();
  if (steps.pitch == 0) throw std::logic_error("the board's corners are on no lattice");
  return {.row = place.row * steps.pitch + (corner < 2 ? steps.tag : 0),
          .column = place.column * steps.pitch + (corner == 1 || corner == 2 ? steps.tag : 0)};
}

namespace {

void ReadSize(const YamlNode& node, BoardDescription& d) {
  const std::optional<GridSize> size = GridSizeFromText(node.As<std::string>());
  if (!size) node.Fail("it is columns x rows, such as 9x6");
  d.columns = size->columns;
  d.rows = size->rows;
}

void ReadTags(YamlMap& map, BoardDescription& d) {
  d.family = map.Get<std::string>("family", d.family);
  d.rows = map.Get<int>("rows", d.rows);
  d.columns = map.Get<int>("columns", d.columns);
  d.tag_size = map.Get<double>("tag_size");
  d.first_id = map.Get<int>("first_id", d.first_id);
  if (const std::optional<YamlNode> first = map.Optional("first_row")) {
    const auto row = first->As<std::string>();
    if (row != "top" && row != "bottom") first->Fail("first_row is top or bottom");
    d.from_bottom = row == "bottom";
  }
  if (d.rows == 1 && d.columns == 1) {
    d.gap = map.Get<double>("gap", 0.0);
  } else {
    d.gap = map.Get<double>("gap");
  }
}

void ReadCharuco(YamlMap& map, BoardDescription& d) {
  d.kind = BoardKind::kCharuco;
  d.square = map.Get<double>("square");
  d.tag_size = map.Get<double>("marker");
  d.dictionary = map.Get<std::string>("dictionary", d.dictionary);
  d.first_id = map.Get<int>("first_id", d.first_id);
  d.legacy = map.Get<bool>("legacy", d.legacy);
}

void ReadCircles(YamlMap& map, BoardDescription& d) {
  d.kind = BoardKind::kCircles;
  d.square = map.Get<double>("spacing");
  d.asymmetric = map.Get<bool>("asymmetric", d.asymmetric);
}

Board BoardOf(BoardDescription description, const YamlNode& node) {
  try {
    return Board(std::move(description));
  } catch (const std::invalid_argument& error) {
    node.Fail(error.what());
  }
}

Board ReadBoard(const YamlNode& node) {
  YamlMap map(node);
  BoardDescription d;
  d.name = map.Get<std::string>("name");
  if (const std::optional<YamlNode> size = map.Optional("chessboard")) {
    d.kind = BoardKind::kChessboard;
    ReadSize(*size, d);
    d.square = map.Get<double>("square");
  } else if (const std::optional<YamlNode> squares = map.Optional("charuco")) {
    ReadSize(*squares, d);
    ReadCharuco(map, d);
  } else if (const std::optional<YamlNode> circles = map.Optional("circles")) {
    ReadSize(*circles, d);
    ReadCircles(map, d);
  } else {
    ReadTags(map, d);
  }
  map.Finish();
  return BoardOf(std::move(d), node);
}

// A board as Kalibr describes it: one map with a target_type, keys in camel case.
Board ReadKalibr(const YamlNode& node, const std::string& file) {
  YamlMap map(node);
  BoardDescription d;
  d.name = std::filesystem::path(file).stem().string();
  const YamlNode type = map.Required("target_type");
  const auto kind = type.As<std::string>();
  if (kind == "aprilgrid") {
    d.family = kKalibrFamily;
    d.columns = map.Get<int>("tagCols");
    d.rows = map.Get<int>("tagRows");
    d.tag_size = map.Get<double>("tagSize");
    d.gap = d.tag_size * map.Get<double>("tagSpacing");
    d.from_bottom = true;
    d.first_id = map.Get<int>("codeOffset", d.first_id);
  } else if (kind == "checkerboard") {
    d.kind = BoardKind::kChessboard;
    d.columns = map.Get<int>("targetCols");
    d.rows = map.Get<int>("targetRows");
    d.square = map.Get<double>("rowSpacingMeters");
    const YamlNode columns = map.Required("colSpacingMeters");
    if (columns.As<double>() != d.square) columns.Fail("squares must be as wide as high");
  } else if (kind == "circlegrid") {
    d.kind = BoardKind::kCircles;
    d.columns = map.Get<int>("targetCols");
    d.rows = map.Get<int>("targetRows");
    d.square = map.Get<double>("spacingMeters");
    d.asymmetric = map.Get<bool>("asymmetricGrid", d.asymmetric);
  } else {
    type.Fail("target_type is aprilgrid, checkerboard or circlegrid");
  }
  map.Finish();
  return BoardOf(std::move(d), node);
}

// What is wrong with a board of squares or circles by itself; empty if nothing is.
std::string SquaresFault(const BoardDescription& d) {
  if (d.square > kLargestTag) {
    return absl::StrCat(d.kind == BoardKind::kCircles ? "spacing " : "square ", d.square,
                        " is in metres; millimetres must be divided by 1000");
  }
  if (d.kind != BoardKind::kCharuco) return "";
  int markers = 0;
  try {
    markers = ArucoDictionary(d.dictionary)->bytesList.rows;
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  const int64_t beyond = d.first_id + int64_t{d.rows} * d.columns / 2;
  if (beyond <= markers) return "";
  return absl::StrCat("its ids are ", d.first_id, " to ", beyond - 1, ", but ", d.dictionary,
                      " has only 0 to ", markers - 1);
}

// What is wrong with the board by itself; empty if nothing is.
std::string BoardFault(const BoardDescription& d) {
  if (d.kind != BoardKind::kTags) return SquaresFault(d);
  std::optional<TagFamily> family;
  try {
    family.emplace(d.family);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  // As many as rows * columns can be more than an int holds.
  const int64_t beyond = d.first_id + int64_t{d.rows} * d.columns;
  if (beyond > family->tags()) {
    return absl::StrCat("its ids are ", d.first_id, " to ", beyond - 1, ", but ", d.family,
                        " has only 0 to ", family->tags() - 1);
  }
  if (d.tag_size > kLargestTag) {
    return absl::StrCat("tag_size ", d.tag_size,
                        " is in metres; millimetres must be divided by "
                        "1000");
  }
  const double module = d.tag_size / family->width_at_border();
  const double rims = module * (family->total_width() - family->width_at_border());
  if (!family->is_dictionary() && beyond - d.first_id > 1 && d.gap < rims * (1 - 1e-9)) {
    return absl::StrCat("the gap of ", d.gap,
                        " m is too small: the prints of neighbouring tags "
                        "would overlap; it must be at least ",
                        rims, " m between corners");
  }
  return "";
}

// The same name for families whose markers of one id look the same: those of DICT_4X4_50 are the
// first of DICT_4X4_1000, and those of DICT_APRILTAG_36h11 are tags of tag36h11.
std::string MarkerGroup(const std::string& family) {
  constexpr std::string_view kAprilTags = "DICT_APRILTAG_";
  if (family.starts_with(kAprilTags)) return absl::StrCat("tag", family.substr(kAprilTags.size()));
  return family.starts_with("DICT_") ? family.substr(0, family.rfind('_')) : family;
}

// The family of the board's tags or markers; empty: it has none.
std::string MarkerFamilyOf(const BoardDescription& d) {
  if (d.kind == BoardKind::kTags) return d.family;
  return d.kind == BoardKind::kCharuco ? d.dictionary : "";
}

// Why marks of one board may be taken for the other's; empty if they may not.
std::string SharedMarks(const Board& board, const Board& other) {
  const BoardDescription& d = board.description();
  const BoardDescription& o = other.description();
  const bool aruco = d.kind == BoardKind::kCharuco || o.kind == BoardKind::kCharuco;
  if (d.kind != o.kind && !aruco) return "";
  const std::string boards = absl::StrCat("the boards '", o.name, "' and '", d.name, "' ");
  if (!aruco && d.kind != BoardKind::kTags) {
    // Seen from the side a board of 7x5 is one of 5x7, but for asymmetric ones.
    const bool alike = d.asymmetric || o.asymmetric
                           ? board.family() == other.family()
                           : std::minmax(d.rows, d.columns) == std::minmax(o.rows, o.columns);
    if (!alike) return "";
    return absl::StrCat(boards, "are ", d.kind == BoardKind::kCircles ? "circles" : "chessboards",
                        " of one size, so that no image tells them apart; take one out");
  }
  const int first = std::max(d.first_id, o.first_id);
  const auto beyond = [](const BoardDescription& b) {
    const int count = b.rows * b.columns;
    return b.first_id + (b.kind == BoardKind::kTags ? count : count / 2);
  };
  if (MarkerGroup(MarkerFamilyOf(d)) != MarkerGroup(MarkerFamilyOf(o)) ||
      first >= std::min(beyond(d), beyond(o))) {
    return "";
  }
  const std::string same = MarkerFamilyOf(d) == MarkerFamilyOf(o)
                               ? ""
                               : absl::StrCat(", which is the one of ", MarkerFamilyOf(o));
  return absl::StrCat(boards, "both have ", aruco ? "marker " : "tag ", first, " of ",
                      MarkerFamilyOf(d), same, "; print one of them with another first_id");
}

// What is wrong with `boards[at]`, by itself or beside those before it.
std::string BoardFault(std::span<const Board> boards, size_t at) {
  const BoardDescription& d = boards[at].description();
  if (const std::string fault = BoardFault(d); !fault.empty()) {
    return absl::StrCat("board '", d.name, "': ", fault);
  }
  for (const Board& other : boards.first(at)) {
    const BoardDescription& o = other.description();
    if (o.name == d.name) return absl::StrCat("there are two boards '", d.name, "'; rename one");
    if (const std::string fault = SharedMarks(boards[at], other); !fault.empty()) return fault;
  }
  return "";
}

}  // namespace

absl::Status CheckBoards(std::span<const Board> boards) {
  for (size_t i = 0; i < boards.size(); ++i) {
    if (const std::string fault = BoardFault(boards, i); !fault.empty()) {
      return InvalidArgument(fault);
    }
  }
  return absl::OkStatus();
}

std::string BoardFileText(std::span<const Board> boards) {
  std::string text =
      "# Boards for calibration. Lengths in metres: tag_size from corner to corner of a tag, gap\n"
      "# between the corners of neighbours. If the print measures otherwise, correct them here.\n";
  for (const Board& board : boards) {
    const BoardDescription& d = board.description();
    const std::string size = absl::StrCat(d.columns, "x", d.rows);
    absl::StrAppend(&text, "- name: ", YamlQuoted(d.name), "\n");
    switch (d.kind) {
      case BoardKind::kTags:
        absl::StrAppend(&text, "  family: ", YamlQuoted(d.family), "\n  rows: ", d.rows,
                        "\n  columns: ", d.columns, "\n  tag_size: ", CsvNumber(d.tag_size),
                        "\n  gap: ", CsvNumber(d.gap), "\n  first_id: ", d.first_id, "\n",
                        d.from_bottom ? "  first_row: bottom\n" : "");
        break;
      case BoardKind::kChessboard:
        absl::StrAppend(&text, "  chessboard: ", size, "  # inner corners, columns x rows\n",
                        "  square: ", CsvNumber(d.square), "\n");
        break;
      case BoardKind::kCharuco:
        absl::StrAppend(&text, "  charuco: ", size, "  # squares, columns x rows\n",
                        "  square: ", CsvNumber(d.square), "\n  marker: ", CsvNumber(d.tag_size),
                        "\n  dictionary: ", d.dictionary, "\n  first_id: ", d.first_id, "\n",
                        d.legacy ? "  legacy: true\n" : "");
        break;
      case BoardKind::kCircles:
        absl::StrAppend(&text, "  circles: ", size, "  # columns x rows\n",
                        "  spacing: ", CsvNumber(d.square), "\n",
                        d.asymmetric ? "  asymmetric: true\n" : "");
        break;
    }
  }
  return text;
}

absl::StatusOr<std::vector<Board>> BoardsFromText(const std::string& text,
                                                  const std::string& file) {
  try {
    const YamlNode root = YamlNode::FromText(text, file);
    std::vector<Board> boards;
    const bool kalibr = root.IsMap() && YamlMap(root).Optional("target_type").has_value();
    for (const YamlNode& item : kalibr ? std::vector{root} : root.Items()) {
      boards.push_back(kalibr ? ReadKalibr(item, file) : ReadBoard(item));
      if (const std::string fault = BoardFault(boards, boards.size() - 1); !fault.empty()) {
        item.Fail(fault);
      }
    }
    if (boards.empty()) root.Fail("there is no board");
    return boards;
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

}  // namespace silhouette
