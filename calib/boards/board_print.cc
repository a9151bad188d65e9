// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/board_print.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "calib/boards/charuco.h"
#include "calib/boards/tag_family.h"

namespace silhouette {
namespace {

using Eigen::AlignedBox2d;
using Eigen::Vector2d;

AlignedBox2d Square(const Vector2d& top_left, double side) {
  return {top_left, top_left + Vector2d::Constant(side)};
}

void AddModules(const TagModules& modules, const Vector2d& top_left, double module,
                BoardPrint& print) {
  for (int row = 0; row < modules.width; ++row) {
    for (int column = 0; column < modules.width; ++column) {
      if (modules.White(column, row)) continue;
      print.black.push_back(Square(top_left + module * Vector2d(column, row), module));
    }
  }
}

// The squares whose corners touch those of Kalibr's tags.
void AddSquaresBetween(const BoardDescription& d, BoardPrint& print) {
  const double pitch = d.tag_size + d.gap;
  for (int row = 0; row <= d.rows; ++row) {
    for (int column = 0; column <= d.columns; ++column) {
      print.black.push_back(
          Square(pitch * Vector2d(column, row) - Vector2d::Constant(d.gap), d.gap));
    }
  }
}

void AddTags(const Board& board, BoardPrint& print) {
  const BoardDescription& d = board.description();
  const TagFamily family(d.family);
  const double module = d.tag_size / family.width_at_border();
  const double rim = module * (family.total_width() - family.width_at_border()) / 2;
  for (int id = d.first_id; board.HasTag(id); ++id) {
    const Vector2d top_left = board.CornersOf(id)[3].head<2>() - Vector2d::Constant(rim);
    AddModules(family.Modules(id), top_left, module, print);
  }
  if (d.family == kKalibrFamily && board.tags() > 1) AddSquaresBetween(d, print);
}

// Of a chessboard and a ChArUco board; the origin is the first inner corner.
void AddSquares(const BoardDescription& d, int rows, int columns, BoardPrint& print) {
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if (!IsBlackSquare(d, row, column)) continue;
      print.black.push_back(Square(d.square * Vector2d(column - 1, row - 1), d.square));
    }
  }
}

void AddMarkers(const BoardDescription& d, BoardPrint& print) {
  const auto dictionary = ArucoDictionary(d.dictionary);
  const double module = d.tag_size / (dictionary->markerSize + 2);
  const Vector2d inset = Vector2d::Constant((d.square - d.tag_size) / 2);
  for (const CharucoMarker& marker : MarkersOf(d)) {
    const Vector2d square = d.square * Vector2d(marker.column - 1, marker.row - 1);
    AddModules(ArucoModules(*dictionary, marker.id), square + inset, module, print);
  }
}

// Strips of equal height, each as wide as the circle is in the mean over its height.
void AddDisc(const Vector2d& middle, double radius, BoardPrint& print) {
  constexpr int kStrips = 64;
  // Of the half circle above `y`, for a radius of 1.
  const auto area = [](double y) { return (y * std::sqrt(1 - y * y) + std::asin(y)) / 2; };
  for (int strip = 0; strip < kStrips; ++strip) {
    const double top = -1 + 2.0 * strip / kStrips;
    const double bottom = std::min(1.0, -1 + 2.0 * (strip + 1) / kStrips);
    const double half = (area(bottom) - area(top)) / (bottom - top);
    print.black.emplace_back(middle + radius * Vector2d(-half, top),
                             middle + radius * Vector2d(half, bottom));
  }
}

void AddDiscs(const Board& board, BoardPrint& print) {
  const double radius = NeighbourDistance(board.description()) / 4;
  for (int id = board.first_mark(); board.HasTag(id); ++id) {
    AddDisc(board.CornersOf(id)[0].head<2>(), radius, print);
  }
}

}  // namespace

BoardPrint PrintOf(const Board& board) {
  if (const absl::Status status = CheckBoards({&board, 1}); !status.ok()) {
    throw std::invalid_argument(std::string(status.message()));
  }
  const BoardDescription& d = board.description();
  const Vector2d rim = Vector2d::Constant(PrintRim(board));
  BoardPrint print{.extent = {-rim, board.extent() + rim}, .black = {}};
  switch (d.kind) {
    case BoardKind::kTags:
      AddTags(board, print);
      break;
    case BoardKind::kChessboard:
      AddSquares(d, d.rows + 1, d.columns + 1, print);
      break;
    case BoardKind::kCharuco:
      AddSquares(d, d.rows, d.columns, print);
      AddMarkers(d, print);
      break;
    case BoardKind::kCircles:
      AddDiscs(board, print);
      break;
  }
  return print;
}

double PrintRim(const Board& board) {
  const BoardDescription& d = board.description();
  if (d.kind != BoardKind::kTags) return d.square;
  const TagFamily family(d.family);
  const double module = d.tag_size / family.width_at_border();
  const double rim = module * (family.total_width() - family.width_at_border()) / 2;
  return d.family == kKalibrFamily ? std::max(rim, d.gap) : rim;
}

}  // namespace silhouette
