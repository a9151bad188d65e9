// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/board_views.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <opencv2/calib3d.hpp>

#include "absl/strings/str_cat.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

// Largest rms of a view's corners about their homography, as a share of the tags' sides: lenses
// bend less.
constexpr double kLargestMisfit = 0.3;

// A way to lay the tags' ids out: the place (row by row) of the tag that stands at (row, column).
using Order = std::function<int(int row, int column, int rows, int columns)>;

struct Mistake {
  const char* says;
  bool exchanged;  // rows and columns
  Order order;
};

const std::vector<Mistake>& Mistakes() {
  static const std::vector<Mistake> mistakes = {
      {"its ids run from right to left: the print or the images are mirrored", false,
       [](int row, int column, int, int columns) { return row * columns + columns - 1 - column; }},
      {"its ids run from bottom to top: the print or the images are mirrored", false,
       [](int row, int column, int rows, int columns) {
         return (rows - 1 - row) * columns + column;
       }},
      {"its rows and columns seem to be exchanged", true,
       [](int row, int column, int, int columns) { return row * columns + column; }},
      {"its ids run down the columns, not along the rows", false,
       [](int row, int column, int rows, int) { return column * rows + row; }},
  };
  return mistakes;
}

// rms of the distances from the best homography over the mean side of the tags, if they lay in
// `order`; nothing if too few were seen.
std::optional<double> Misfit(const Board& board, const BoardView& view, const Order& order,
                             bool exchanged) {
  const BoardDescription& d = board.description();
  const int rows = exchanged ? d.columns : d.rows;
  const int columns = exchanged ? d.rows : d.columns;
  const double pitch = d.tag_size + d.gap;
  std::vector<cv::Point2d> on_board;
  std::vector<cv::Point2d> seen;
  double sides = 0;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int place = order(row, column, rows, columns);
      std::array<Eigen::Vector3d, 4> pixels;
      const TagCorners corners = board.CornersOf(d.first_id);
      for (int corner = 0; corner < 4; ++corner) {
        pixels[static_cast<size_t>(corner)] = view.corners[LatticeIndex(board, place, corner)];
      }
      if (pixels[0].z() == kNoCorner) continue;
      for (size_t corner = 0; corner < 4; ++corner) {
        on_board.emplace_back(corners[corner].x() + pitch * column,
                              corners[corner].y() + pitch * row);
        seen.emplace_back(pixels[corner].x(), pixels[corner].y());
        sides += (pixels[corner] - pixels[(corner + 1) % 4]).head<2>().norm() / 4;
      }
    }
  }
  if (seen.size() < 12) return std::nullopt;
  const cv::Mat homography = cv::findHomography(on_board, seen, 0);
  if (homography.empty()) return std::nullopt;
  std::vector<cv::Point2d> mapped;
  cv::perspectiveTransform(on_board, mapped, homography);
  double squares = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    const cv::Point2d off = mapped[i] - seen[i];
    squares += off.dot(off);
  }
  const double tags = static_cast<double>(seen.size()) / 4;
  return std::sqrt(squares / static_cast<double>(seen.size())) / (sides / tags);
}

std::optional<double> MedianMisfit(const Board& board, const std::vector<const BoardView*>& views,
                                   const Order& order, bool exchanged = false) {
  std::vector<double> misfits;
  for (const BoardView* view : views) {
    if (const auto misfit = Misfit(board, *view, order, exchanged)) misfits.push_back(*misfit);
  }
  if (misfits.empty()) return std::nullopt;
  return Median(std::move(misfits));
}

// Whether the corners of most tags run the wrong way round.
bool MostTagsMirrored(const Board& board, const std::vector<const BoardView*>& views) {
  int tags = 0;
  int mirrored = 0;
  for (const BoardView* view : views) {
    for (int place = 0; place < board.tags(); ++place) {
      double area = 0;
      const auto pixel = [&](int corner) {
        return view->corners[LatticeIndex(board, place, corner % 4)];
      };
      if (pixel(0).z() == kNoCorner) continue;
      for (int corner = 0; corner < 4; ++corner) {
        const Eigen::Vector3d a = pixel(corner);
        const Eigen::Vector3d b = pixel(corner + 1);
        area += a.x() * b.y() - a.y() * b.x();
      }
      ++tags;
      if (area > 0) ++mirrored;
    }
  }
  return 2 * mirrored > tags;
}

}  // namespace

absl::Status CheckBoardShapes(const std::vector<LensCamera>& cameras,
                              const std::vector<Board>& boards,
                              const std::vector<BoardView>& views) {
  std::map<std::pair<size_t, size_t>, std::vector<const BoardView*>> by_camera;
  for (const BoardView& view : views) by_camera[{view.camera, view.board}].push_back(&view);
  for (const auto& [key, group] : by_camera) {
    const Board& board = boards[key.second];
    const std::string where = absl::StrCat("board '", board.description().name, "', seen by '",
                                           cameras[key.first].name, "': ");
    if (MostTagsMirrored(board, group)) {
      return absl::InvalidArgumentError(absl::StrCat(
          where,
          "the tags' corners run the wrong way round; the images are mirrored (switch off the "
          "camera's mirroring), or their order is not bottom left, bottom right, top right, top "
          "left"));
    }
    const Order as_described = [](int row, int column, int, int columns) {
      return row * columns + column;
    };
    const auto misfit = MedianMisfit(board, group, as_described);
    if (!misfit || *misfit < kLargestMisfit) continue;
    for (const Mistake& mistake : Mistakes()) {
      const auto other = MedianMisfit(board, group, mistake.order, mistake.exchanged);
      if (other && *other < kLargestMisfit) {
        return absl::InvalidArgumentError(
            absl::StrCat(where, mistake.says, "; print the board again, or describe it as it is"));
      }
    }
    return absl::InvalidArgumentError(absl::StrCat(
        where,
        "its tags do not lie as the description says; compare rows, columns, gap and first_id with "
        "the print, and see that it is flat"));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
