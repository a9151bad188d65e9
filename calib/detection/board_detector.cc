// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/board_detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <utility>

#include "calib/boards/charuco.h"
#include "calib/boards/tag_family.h"
#include "calib/detection/circle_grid.h"
#include "calib/detection/corner_fit.h"
#include "calib/detection/missed_tags.h"

namespace silhouette {
namespace {

using Eigen::Vector2d;

// Of corners without fitted edges, pixels.
constexpr double kUnfittedSigma = 0.1;
// The markers next to a corner that say where to look for it.
constexpr size_t kMarkersNear = 4;
// A corner is looked for so far from where markers put it, as a share of a square's side.
constexpr double kSearched = 0.25;
constexpr int kSectors = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE;
// A marker is not where the others say if it lies so far from where their homography puts it, as a
// share of its side; lenses bend less.
constexpr double kMostMisfit = 0.3;
constexpr double kMisread = 1;       // the same of a marker that is left out
constexpr size_t kLeastMarkers = 4;  // of a dictionary that an image shows
// Of the width that a marker leaves of its square: so far edges are looked at on both sides.
constexpr double kQuiet = 0.9;

cv::Point2f PointOf(const Vector2d& at) {
  return {static_cast<float>(at.x()), static_cast<float>(at.y())};
}
Vector2d VectorOf(const cv::Point2f& at) { return {at.x, at.y}; }

// The mean distance of neighbours, pixels; 0 if there are none.
double MeanSide(const ChessCorners& corners) {
  double sum = 0;
  int sides = 0;
  for (size_t i = 0; i < corners.at.size(); ++i) {
    const bool last = (i + 1) % static_cast<size_t>(corners.columns) == 0;
    const size_t below = i + static_cast<size_t>(corners.columns);
    for (const size_t to : {last ? corners.at.size() : i + 1, below}) {
      if (to >= corners.at.size() || !corners.at[i] || !corners.at[to]) continue;
      sum += (*corners.at[to] - *corners.at[i]).norm();
      ++sides;
    }
  }
  return sides > 0 ? sum / sides : 0;
}

// The corners as marks. `kept`: whether a corner whose edges cannot be fitted counts.
std::vector<DetectedTag> MarksOf(const Board& board, const cv::Mat& image,
                                 const std::optional<CameraModel>& lens,
                                 const ChessCorners& corners, double room,
                                 const std::vector<bool>& kept) {
  const auto fitted = FitChessCorners(image, lens, corners, room);
  const double side = MeanSide(corners);
  std::vector<DetectedTag> marks;
  for (size_t i = 0; i < corners.at.size(); ++i) {
    if (!corners.at[i] || (!fitted[i] && !kept[i])) continue;
    DetectedTag mark{.family = board.family(),
                     .tag = board.first_mark() + static_cast<int>(i),
                     .corners = {fitted[i] ? fitted[i]->at : *corners.at[i]},
                     .sigma = fitted[i] ? fitted[i]->sigma : kUnfittedSigma,
                     .size = side};
    mark.fitted = fitted[i].has_value();
    if (fitted[i]) mark.blur = fitted[i]->blur;
    marks.push_back(std::move(mark));
  }
  return marks;
}

}  // namespace

namespace {

double GreyAt(const cv::Mat& image, const Vector2d& at) {
  const int x = std::clamp(static_cast<int>(std::lround(at.x())), 0, image.cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(at.y())), 0, image.rows - 1);
  return image.at<uint8_t>(y, x);
}

// Grey of the squares that should be white, less that of those that should be black.
double Contrast(const cv::Mat& image, const ChessCorners& corners) {
  double sum = 0;
  for (int row = 0; row + 1 < corners.rows; ++row) {
    for (int column = 0; column + 1 < corners.columns; ++column) {
      const size_t at = static_cast<size_t>(row * corners.columns + column);
      const auto columns = static_cast<size_t>(corners.columns);
      const Vector2d middle = (*corners.at[at] + *corners.at[at + 1] + *corners.at[at + columns] +
                               *corners.at[at + columns + 1]) /
                              4;
      sum += ((row + column) % 2 == 0 ? -1 : 1) * GreyAt(image, middle);
    }
  }
  return sum;
}

// Orders them as the board's frame says: not mirrored, a black square before the first one; of a
// board that looks the same upside down the one nearer to the image's top left first.
void Orient(const Board& board, const cv::Mat& image, ChessCorners& corners) {
  const auto columns = static_cast<size_t>(corners.columns);
  const Vector2d along = *corners.at[columns - 1] - *corners.at[0];
  const Vector2d across = *corners.at[corners.at.size() - columns] - *corners.at[0];
  if (along.x() * across.y() - along.y() * across.x() < 0) {
    for (auto row = corners.at.begin(); row != corners.at.end();
         row += static_cast<std::ptrdiff_t>(columns)) {
      std::reverse(row, row + static_cast<std::ptrdiff_t>(columns));
    }
  }
  const bool turned = board.IsAmbiguous() ? corners.at.back()->sum() < corners.at.front()->sum()
                                          : Contrast(image, corners) < 0;
  if (turned) std::ranges::reverse(corners.at);
}

}  // namespace

std::vector<DetectedTag> DetectChessboard(const Board& board, const cv::Mat& image,
                                          const std::optional<CameraModel>& lens) {
  const BoardDescription& d = board.description();
  // OpenCV finds boards better whose rows are the longer way.
  const auto [shorter, longer] = std::minmax(d.rows, d.columns);
  std::vector<cv::Point2f> found;
  if (!cv::findChessboardCornersSB(image, {longer, shorter}, found,
                                   kSectors | cv::CALIB_CB_ACCURACY) ||
      found.size() != static_cast<size_t>(board.tags())) {
    return {};
  }
  ChessCorners corners{.rows = d.rows, .columns = d.columns, .at = {}};
  for (int row = 0; row < d.rows; ++row) {
    for (int column = 0; column < d.columns; ++column) {
      const int at = d.columns >= d.rows ? row * longer + column : column * longer + row;
      corners.at.emplace_back(VectorOf(found[static_cast<size_t>(at)]));
    }
  }
  Orient(board, image, corners);
  return MarksOf(board, image, lens, corners, 1, std::vector<bool>(found.size(), true));
}

std::optional<GridSize> ChessboardIn(const cv::Mat& image) {
  std::vector<cv::Point2f> found;
  cv::Mat squares;
  if (!cv::findChessboardCornersSB(image, {3, 3}, found, kSectors | cv::CALIB_CB_LARGER, squares)) {
    return std::nullopt;
  }
  const auto [shorter, longer] = std::minmax(squares.rows, squares.cols);
  if (longer <= 3) return std::nullopt;  // too little to tell
  return GridSize{.columns = longer, .rows = shorter};
}

namespace {

struct SeenMarker {
  Vector2d middle;  // on the board, metres
  std::array<Vector2d, 4> on_board;
  std::array<Vector2d, 4> seen;  // undistorted pixels
};

std::vector<SeenMarker> MarkersSeen(const BoardDescription& d, const std::vector<int>& ids,
                                    const std::vector<std::array<Vector2d, 4>>& seen) {
  const std::vector<CharucoMarker> markers = MarkersOf(d);
  std::vector<SeenMarker> all;
  for (size_t i = 0; i < ids.size(); ++i) {
    const int place = ids[i] - d.first_id;
    if (place < 0 || place >= static_cast<int>(markers.size())) continue;
    const CharucoMarker& marker = markers[static_cast<size_t>(place)];
    const Vector2d middle = d.square * Vector2d(marker.column - 0.5, marker.row - 0.5);
    const double half = d.tag_size / 2;
    all.push_back({.middle = middle,
                   .on_board = {middle + Vector2d(-half, -half), middle + Vector2d(half, -half),
                                middle + Vector2d(half, half), middle + Vector2d(-half, half)},
                   .seen = seen[i]});
  }
  return all;
}

// Of the board's plane to undistorted pixels, by OpenCV's `method`. Empty if there is none.
cv::Mat HomographyOf(const std::vector<SeenMarker>& markers, int method) {
  std::vector<cv::Point2f> from;
  std::vector<cv::Point2f> to;
  for (const SeenMarker& marker : markers) {
    for (size_t i = 0; i < 4; ++i) {
      from.push_back(PointOf(marker.on_board[i]));
      to.push_back(PointOf(marker.seen[i]));
    }
  }
  return from.empty() ? cv::Mat() : cv::findHomography(from, to, method);
}

Vector2d Mapped(const cv::Mat& homography, const Vector2d& at) {
  const cv::Vec3d mapped =
      cv::Mat_<double>(homography * cv::Vec3d(at.x(), at.y(), 1)).at<cv::Vec3d>(0);
  return Vector2d(mapped[0], mapped[1]) / mapped[2];
}

// How far each marker is from where one homography puts most of them, as a share of its side.
std::vector<double> Misfits(const std::vector<SeenMarker>& markers) {
  const cv::Mat homography = HomographyOf(markers, cv::LMEDS);
  if (homography.empty()) return {};
  std::vector<double> misfits;
  for (const SeenMarker& marker : markers) {
    double off = 0;
    double sides = 0;
    for (size_t i = 0; i < 4; ++i) {
      off += (Mapped(homography, marker.on_board[i]) - marker.seen[i]).norm();
      sides += (marker.seen[(i + 1) % 4] - marker.seen[i]).norm();
    }
    misfits.push_back(off / sides);
  }
  return misfits;
}

// Without those that are not where the others say: misread ones.
std::vector<SeenMarker> Fitting(const std::vector<SeenMarker>& markers) {
  const std::vector<double> misfits = Misfits(markers);
  std::vector<SeenMarker> fitting;
  for (size_t i = 0; i < misfits.size(); ++i) {
    if (misfits[i] < kMisread) fitting.push_back(markers[i]);
  }
  return fitting;
}

// Those that are where most of the others say.
size_t CountFitting(const std::vector<SeenMarker>& markers) {
  const std::vector<double> misfits = Misfits(markers);
  return static_cast<size_t>(
      std::ranges::count_if(misfits, [](double misfit) { return misfit < kMostMisfit; }));
}

// The board as it is described, or as its markers show it: boards of an even number of rows are
// laid out in two ways, and rows and columns may be exchanged in the description. Nothing: they
// are another board's.
std::optional<BoardDescription> LayoutOf(const BoardDescription& described,
                                         const std::vector<int>& ids,
                                         const std::vector<std::array<Vector2d, 4>>& seen) {
  BoardDescription best = described;
  const std::vector<SeenMarker> markers = MarkersSeen(described, ids, seen);
  size_t most = CountFitting(markers);
  for (const bool exchanged : {false, true}) {
    for (const bool legacy : {false, true}) {
      BoardDescription other = described;
      other.legacy = legacy;
      if (exchanged) std::swap(other.rows, other.columns);
      const size_t fitting = CountFitting(MarkersSeen(other, ids, seen));
      if (fitting <= most) continue;
      most = fitting;
      best = other;
    }
  }
  return 2 * most > markers.size() ? std::optional(best) : std::nullopt;
}

// Where the inner corner at `point` should be, by the markers near it: an undistorted pixel.
std::optional<Vector2d> Predicted(std::vector<SeenMarker> markers, const Vector2d& point) {
  const size_t near = std::min(kMarkersNear, markers.size());
  std::ranges::partial_sort(markers, markers.begin() + static_cast<std::ptrdiff_t>(near), {},
                            [&](const SeenMarker& m) { return (m.middle - point).norm(); });
  markers.resize(near);
  const cv::Mat homography = HomographyOf(markers, 0);
  if (homography.empty()) return std::nullopt;
  return Mapped(homography, point);
}

// Corners of the grey values' gradients near where they are said to be; gone where there are none.
void MoveToCorners(const cv::Mat& image, ChessCorners& corners) {
  const double side = MeanSide(corners);
  const int reach = std::clamp(static_cast<int>(kSearched * side), 2, 8);
  for (std::optional<Vector2d>& at : corners.at) {
    if (!at) continue;
    if (at->minCoeff() < reach || at->x() > image.cols - 1 - reach ||
        at->y() > image.rows - 1 - reach) {
      at.reset();
      continue;
    }
    std::vector<cv::Point2f> moved = {PointOf(*at)};
    cv::cornerSubPix(image, moved, {reach, reach}, {-1, -1},
                     {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 40, 1e-3});
    const Vector2d to = VectorOf(moved.front());
    at = (to - *at).norm() < reach ? std::optional(to) : std::nullopt;
  }
}

}  // namespace

std::vector<DetectedTag> DetectCharuco(const Board& described, const cv::Mat& image,
                                       const std::optional<CameraModel>& lens) {
  std::vector<int> ids;
  std::vector<std::vector<cv::Point2f>> found;
  cv::aruco::detectMarkers(image, ArucoDictionary(described.description().dictionary), found, ids);
  std::vector<std::array<Vector2d, 4>> seen;
  std::vector<int> usable;
  for (size_t i = 0; i < ids.size(); ++i) {
    std::array<Vector2d, 4> marker;
    bool all = true;
    for (size_t k = 0; k < 4; ++k) {
      const auto at = Undistorted(lens, VectorOf(found[i][k]));
      all = all && at;
      if (at) marker[k] = *at;
    }
    if (!all) continue;
    seen.push_back(marker);
    usable.push_back(ids[i]);
  }
  const std::optional<BoardDescription> layout = LayoutOf(described.description(), usable, seen);
  if (!layout) return {};
  const Board board(*layout);
  const BoardDescription& d = board.description();
  const std::vector<SeenMarker> markers = Fitting(MarkersSeen(d, usable, seen));
  ChessCorners corners{.rows = d.rows - 1, .columns = d.columns - 1, .at = {}};
  std::vector<bool> kept;
  for (int id = board.first_mark(); board.HasTag(id); ++id) {
    const Vector2d point = board.CornersOf(id).front().head<2>();
    const auto beside = std::ranges::count_if(markers, [&](const SeenMarker& marker) {
      return (marker.middle - point).lpNorm<Eigen::Infinity>() < 0.75 * d.square;
    });
    const auto predicted = beside > 0 ? Predicted(markers, point) : std::nullopt;
    corners.at.push_back(predicted ? Distorted(lens, *predicted) : std::nullopt);
    kept.push_back(beside > 1);
  }
  MoveToCorners(image, corners);
  const double room = kQuiet * (d.square - d.tag_size) / d.square;
  return MarksOf(board, image, lens, corners, room, kept);
}

std::string DictionaryIn(const cv::Mat& image) {
  std::string best;
  size_t most = kLeastMarkers - 1;
  for (const std::string& name : ArucoDictionaryNames()) {
    std::vector<int> ids;
    std::vector<std::vector<cv::Point2f>> found;
    cv::aruco::detectMarkers(image, ArucoDictionary(name), found, ids);
    if (ids.size() <= most) continue;
    most = ids.size();
    best = name;
  }
  return best;
}

BoardDetector::BoardDetector(std::vector<Board> boards) : boards_(std::move(boards)) {
  if (boards_.empty()) throw std::invalid_argument("no board is to be looked for");
  if (const absl::Status status = CheckBoards(boards_); !status.ok()) {
    throw std::invalid_argument(std::string(status.message()));
  }
  const std::vector<std::string> families = FamiliesOf(boards_);
  if (!families.empty()) tags_.emplace(families);
}

std::vector<DetectedTag> BoardDetector::Detect(const cv::Mat& image,
                                               const std::optional<CameraModel>& lens) {
  if (image.type() != CV_8UC1) throw std::invalid_argument("boards are looked for in grey images");
  std::vector<DetectedTag> all;
  if (tags_) all = tags_->Detect(image, lens);
  for (const Board& board : boards_) {
    const BoardKind kind = board.description().kind;
    const bool kalibr = board.family() == kKalibrFamily;
    if (kind == BoardKind::kTags && !kalibr && !TagFamily(board.family()).is_dictionary()) continue;
    // A square that the library took for a part of a tag has drawn its corner away.
    if (kalibr) {
      std::erase_if(all, [&](const DetectedTag& tag) {
        return board.HasTag(tag.family, tag.tag) && !tag.fitted;
      });
    }
    std::vector<DetectedTag> marks;
    switch (kind) {
      case BoardKind::kTags:
        marks = MissedTags(board, image, lens, all);
        break;
      case BoardKind::kChessboard:
        marks = DetectChessboard(board, image, lens);
        break;
      case BoardKind::kCharuco:
        marks = DetectCharuco(board, image, lens);
        break;
      case BoardKind::kCircles:
        marks = DetectCircles(board, image);
        break;
    }
    std::ranges::move(marks, std::back_inserter(all));
  }
  return all;
}

std::vector<std::string> FamiliesOf(std::span<const Board> boards) {
  std::set<std::string> families;
  for (const Board& board : boards) {
    if (board.description().kind == BoardKind::kTags) families.insert(board.family());
  }
  return {families.begin(), families.end()};
}

}  // namespace silhouette
