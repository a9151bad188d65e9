// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/board.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/boards/csv.h"
#include "calib/boards/tag_family.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr int kMostTags = 1'000'000;

}  // namespace

Board::Board(BoardDescription description) : description_(std::move(description)) {
  const BoardDescription& d = description_;
  const auto require = [&](bool holds, const std::string& what) {
    if (!holds) throw std::invalid_argument("board '" + d.name + "': " + what);
  };
  require(!d.name.empty(), "a board needs a name");
  require(!d.family.empty(), "a board needs a tag family");
  require(d.rows > 0 && d.columns > 0, "there must be at least one row and one column of tags");
  require(d.rows <= kMostTags / d.columns, "there are too many tags");
  require(std::isfinite(d.tag_size) && d.tag_size > 0, "tag_size must be positive");
  require(tags() == 1 || (std::isfinite(d.gap) && d.gap > 0),
          "the gap between tags must be positive");
  require(d.first_id >= 0, "first_id must not be negative");
  require(d.first_id <= std::numeric_limits<int>::max() - kMostTags, "first_id is too large");
}

bool Board::HasTag(int id) const {
  return id >= description_.first_id && id - description_.first_id < tags();
}

TagCorners Board::CornersOf(int id) const {
  if (!HasTag(id)) {
    throw std::out_of_range("board '" + description_.name + "' has no tag " + std::to_string(id));
  }
  const int place = id - description_.first_id;
  const double pitch = description_.tag_size + description_.gap;
  const double left = pitch * (place % description_.columns);
  const double top = pitch * (place / description_.columns);
  const double right = left + description_.tag_size;
  const double bottom = top + description_.tag_size;
  return {Eigen::Vector3d(left, bottom, 0), Eigen::Vector3d(right, bottom, 0),
          Eigen::Vector3d(right, top, 0), Eigen::Vector3d(left, top, 0)};
}

bool Board::IsLattice() const {
  return tags() == 1 ||
         std::abs(description_.gap - description_.tag_size) <= 1e-9 * description_.tag_size;
}

namespace {

Board ReadBoard(const YamlNode& node) {
  YamlMap map(node);
  BoardDescription d;
  d.name = map.Get<std::string>("name");
  d.family = map.Get<std::string>("family", d.family);
  d.rows = map.Get<int>("rows", d.rows);
  d.columns = map.Get<int>("columns", d.columns);
  d.tag_size = map.Get<double>("tag_size");
  d.first_id = map.Get<int>("first_id", d.first_id);
  if (d.rows == 1 && d.columns == 1) {
    d.gap = map.Get<double>("gap", 0.0);
  } else {
    d.gap = map.Get<double>("gap");
  }
  map.Finish();
  try {
    return Board(std::move(d));
  } catch (const std::invalid_argument& error) {
    node.Fail(error.what());
  }
}

// What is wrong with the board by itself; empty if nothing is.
std::string BoardFault(const BoardDescription& d) {
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
  if (beyond - d.first_id > 1 && d.gap < rims * (1 - 1e-9)) {
    return absl::StrCat("the gap of ", d.gap,
                        " m is too small: the prints of neighbouring tags "
                        "would overlap; it must be at least ",
                        rims, " m between corners");
  }
  return "";
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
    const int first = std::max(d.first_id, o.first_id);
    if (o.family == d.family && boards[at].HasTag(first) && other.HasTag(first)) {
      return absl::StrCat("the boards '", o.name, "' and '", d.name, "' both have tag ", first,
                          " of ", d.family, "; print one of them with another first_id");
    }
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
      "# Boards of AprilTags. Lengths in metres: tag_size from corner to corner of a tag, gap\n"
      "# between the corners of neighbours. If the print measures otherwise, correct them here.\n";
  for (const Board& board : boards) {
    const BoardDescription& d = board.description();
    absl::StrAppend(&text, "- name: ", YamlQuoted(d.name), "\n  family: ", YamlQuoted(d.family),
                    "\n  rows: ", d.rows, "\n  columns: ", d.columns,
                    "\n  tag_size: ", CsvNumber(d.tag_size), "\n  gap: ", CsvNumber(d.gap),
                    "\n  first_id: ", d.first_id, "\n");
  }
  return text;
}

absl::StatusOr<std::vector<Board>> BoardsFromText(const std::string& text,
                                                  const std::string& file) {
  try {
    const YamlNode root = YamlNode::FromText(text, file);
    std::vector<Board> boards;
    for (const YamlNode& item : root.Items()) {
      boards.push_back(ReadBoard(item));
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
