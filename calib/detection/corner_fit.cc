// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/corner_fit.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "common/numbers/numbers.h"

namespace silhouette {

std::optional<Eigen::Vector2d> Undistorted(const std::optional<CameraModel>& lens,
                                           const Eigen::Vector2d& pixel) {
  return lens ? lens->Undistorted(pixel) : pixel;
}

std::optional<Eigen::Vector2d> Distorted(const std::optional<CameraModel>& lens,
                                         const Eigen::Vector2d& undistorted) {
  return lens ? lens->Distorted(undistorted) : undistorted;
}

Eigen::Matrix2d UndistortedPerPixel(const std::optional<CameraModel>& lens,
                                    const Eigen::Vector2d& pixel) {
  if (!lens) return Eigen::Matrix2d::Identity();
  constexpr double kStep = 0.5;
  Eigen::Matrix2d result;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
    const auto before = lens->Undistorted(pixel - step);
    const auto after = lens->Undistorted(pixel + step);
    if (!before || !after) return Eigen::Matrix2d::Identity();
    result.col(axis) = (*after - *before) / (2 * kStep);
  }
  return result;
}

namespace {

constexpr double kMostReach = 4;  // pixels beside an edge
constexpr double kReachInBorders = 0.55;
constexpr double kMostMoved = 1.5;         // pixels, of a corner by the fit
constexpr double kMostMovedInSides = 0.1;  // the same, sides of squares that are larger
// The outermost squares may be cut: so much of a side they have at least.
constexpr double kRimSquare = 0.45;
// The lens bends longer edges, pixels, more than some corners say; their own grey values know it
// better.
constexpr double kOwnBend = 100;
constexpr double kMostMovedRim = 1.5;  // pixels, between the edges before and beyond a corner
// The second round looks at the pixels that lie evenly beside what the first has found.
constexpr int kRounds = 2;
constexpr double kFirstCornerBlur = 0.8;
// The fits take what of the next modules is within reach for noise, and doubt themselves too much.
constexpr double kOfFit = 0.88;
// What no edge's fit knows of: grey values that do not follow the model, and, the less a module is
// wider than the blur, the next modules' grey. Measured on rendered tags.
constexpr double kLeastSigma = 0.003;
constexpr double kNeighbourSigma = 0.11;
constexpr double kNeighbourRatio = 3.9;
// Where white is cut off, the middle grey, and with it the edge, moves into the dark side: by this
// share of the blur. A tag becomes smaller.
constexpr double kSaturatedSigma = 0.22;

// As TagDetector does not fit narrower modules.
constexpr double kLeastSideInBlurs = 3.5;

// Pixels at the end of an edge where the next one shows.
double EndGap(double blur) { return std::max(2.0, 1 + 2 * blur); }

double SigmaOf(double of_fit, double blur, double border, double saturation) {
  const double neighbours = kNeighbourSigma * std::pow(kNeighbourRatio * blur / border, 5);
  const double white = kSaturatedSigma * saturation * blur;
  return std::hypot(std::hypot(kOfFit * of_fit, neighbours, kLeastSigma), white);
}

struct Meeting {
  Eigen::Vector2d at;  // undistorted
  Eigen::Matrix2d covariance;
};

// Where two edges meet, near `at`.
std::optional<Meeting> Meet(const Edge& a, const Edge& b, Eigen::Vector2d at) {
  Eigen::Matrix2d gradients;
  for (int step = 0; step < 10; ++step) {
    gradients.row(0) = a.Gradient(at).transpose();
    gradients.row(1) = b.Gradient(at).transpose();
    if (std::abs(gradients.determinant()) < 0.05) return std::nullopt;  // nearly parallel
    const Eigen::Vector2d move =
        gradients.inverse() * Eigen::Vector2d(a.Distance(at), b.Distance(at));
    at -= move;
    if (move.norm() < 1e-9) break;
  }
  const Eigen::Matrix2d inverse = gradients.inverse();
  const Eigen::Vector2d variances(a.Variance(a.Along(at)), b.Variance(b.Along(at)));
  return Meeting{at, inverse * variances.asDiagonal() * inverse.transpose()};
}

std::optional<std::vector<Edge>> FitEdges(const cv::Mat& image,
                                          const std::optional<CameraModel>& lens,
                                          const PixelCorners& undistorted, double border,
                                          double blur) {
  EdgeFitSettings settings;
  settings.reach = std::min(kMostReach, kReachInBorders * border);
  settings.end_gap = EndGap(blur);
  settings.curved = !lens;
  std::vector<Edge> edges;
  for (int i = 0; i < 4; ++i) {
    const std::optional<Edge> edge =
        FitEdge(image, lens, undistorted[i], undistorted[(i + 1) % 4], settings);
    if (!edge) return std::nullopt;
    edges.push_back(*edge);
  }
  return edges;
}

}  // namespace

std::optional<FittedCorners> FitCorners(const cv::Mat& image,
                                        const std::optional<CameraModel>& lens,
                                        const PixelCorners& corners, double border) {
  PixelCorners undistorted;
  for (int i = 0; i < 4; ++i) {
    const auto at = Undistorted(lens, corners[i]);
    if (!at) return std::nullopt;
    undistorted[i] = *at;
  }
  FittedCorners fitted;
  fitted.blur = kFirstCornerBlur;
  double saturation = 0;
  for (int round = 0; round < kRounds; ++round) {
    const auto edges = FitEdges(image, lens, undistorted, border, fitted.blur);
    if (!edges) return std::nullopt;
    double variance = 0;
    fitted.blur = fitted.contrast = saturation = 0;
    for (int i = 0; i < 4; ++i) {
      const auto corner = Meet((*edges)[(i + 3) % 4], (*edges)[i], undistorted[i]);
      if (!corner) return std::nullopt;
      const auto pixel = Distorted(lens, corner->at);
      if (!pixel || !((*pixel - corners[i]).norm() < kMostMoved)) return std::nullopt;
      const Eigen::Matrix2d to_pixels = UndistortedPerPixel(lens, *pixel).inverse();
      variance += (to_pixels * corner->covariance * to_pixels.transpose()).trace() / 8;
      undistorted[i] = corner->at;
      fitted.corners[i] = *pixel;
      fitted.blur += (*edges)[i].blur() / 4;
      fitted.contrast += (*edges)[i].contrast() / 4;
      saturation += (*edges)[i].saturation() / 4;
    }
    fitted.sigma = std::sqrt(variance);
  }
  fitted.sigma = SigmaOf(fitted.sigma, fitted.blur, border, saturation);
  return fitted;
}

namespace {

// The edges of a chessboard between neighbouring corners, and those of the outermost corners to the
// rim of the board, in undistorted pixels. Ink and exposure move edges towards one colour: the two
// edges that end at a corner opposite each other move in opposite directions, so the mean of both
// stays where it is.
class ChessEdges {
 public:
  ChessEdges(const cv::Mat& image, const std::optional<CameraModel>& lens,
             const ChessCorners& corners, double room, double blur)
      : image_(image), lens_(lens), corners_(corners), room_(room), blur_(blur) {
    for (int row = 0; row < corners.rows; ++row) FitLine({row, -1}, {0, 1}, along_);
    for (int column = 0; column < corners.columns; ++column) {
      FitLine({-1, column}, {1, 0}, across_);
    }
  }

  // Those that end at a corner, along its row or its column.
  std::vector<Edge> Along(size_t corner) const { return EndingAt(along_, PlaceOf(corner), 1); }
  std::vector<Edge> Across(size_t corner) const { return EndingAt(across_, PlaceOf(corner), 0); }
  // From a corner to the nearest of its neighbours.
  double SideAt(size_t corner) const {
    const Place at = PlaceOf(corner);
    double least = std::numeric_limits<double>::infinity();
    for (const Place& step : {Place{-1, 0}, Place{1, 0}, Place{0, -1}, Place{0, 1}}) {
      const auto neighbour = At({at[0] + step[0], at[1] + step[1]});
      if (neighbour) least = std::min(least, (*neighbour - *At(at)).norm());
    }
    return least;
  }

 private:
  using Place = std::array<int, 2>;  // row, column

  static bool IsLong(const Edge& edge) { return edge.length() > kOwnBend; }

  Place PlaceOf(size_t corner) const {
    const int at = static_cast<int>(corner);
    return {at / corners_.columns, at % corners_.columns};
  }
  bool IsCorner(const Place& at) const {
    return at[0] >= 0 && at[1] >= 0 && at[0] < corners_.rows && at[1] < corners_.columns;
  }
  std::optional<Eigen::Vector2d> At(const Place& at) const {
    if (!IsCorner(at)) return std::nullopt;
    return corners_.at[static_cast<size_t>(at[0] * corners_.columns + at[1])];
  }

  // Where the edge through the outermost corner `last` ends, as the corners before it lie.
  std::optional<Eigen::Vector2d> Rim(const Place& last, const Place& inwards) const {
    const auto a = At(last);
    const auto b = At({last[0] + inwards[0], last[1] + inwards[1]});
    const auto c = At({last[0] + 2 * inwards[0], last[1] + 2 * inwards[1]});
    if (!a || !b || !c) return std::nullopt;
    const double side = (*a - *b).squaredNorm() / (*b - *c).norm();
    const Eigen::Vector2d rim = *a + (kRimSquare * side + EndGap(blur_)) * (*a - *b).normalized();
    const auto pixel = Distorted(lens_, rim);
    const bool seen = pixel && pixel->minCoeff() >= 0 && pixel->x() <= image_.cols - 1 &&
                      pixel->y() <= image_.rows - 1;
    return seen ? std::optional(rim) : std::nullopt;
  }

  // How the corners in line with an edge bend it: if it is short, its own grey values know that
  // less well. A cubic through the nearest four, or a parabola through three; nothing: there are
  // fewer. `place`: where the edge begins.
  std::optional<Bend> BendOf(const Edge& straight, const Place& place, const Place& step) const {
    constexpr size_t kNodes = 4;
    std::vector<double> along;
    std::vector<double> differences;
    for (const int steps : {0, 1, -1, 2, -2, 3, -3, 4}) {
      // Of a short edge at a row's end, a fourth corner tells less than its noise spoils.
      const bool beside = steps >= -1 && steps <= 2;
      const size_t most = beside || IsLong(straight) ? kNodes : kNodes - 1;
      const auto at = At({place[0] + steps * step[0], place[1] + steps * step[1]});
      if (!at || along.size() >= most) continue;
      along.push_back(straight.Along(*at));
      differences.push_back(straight.Distance(*at));
    }
    if (along.size() < kNodes - 1) return std::nullopt;
    // Newton's divided differences.
    for (size_t order = 1; order < along.size(); ++order) {
      for (size_t i = along.size() - 1; i >= order; --i) {
        differences[i] = (differences[i] - differences[i - 1]) / (along[i] - along[i - order]);
      }
    }
    Bend bend{.quadratic = differences[2]};
    if (along.size() == kNodes) {
      bend.cubic = differences[3];
      bend.quadratic -= bend.cubic * (along[0] + along[1] + along[2]);
    }
    return bend;
  }

  // The edge from `place` to the next one; one of the two may lie on the rim, beside a corner.
  std::optional<Edge> Fit(const Place& place, const Place& step) const {
    const Place next = {place[0] + step[0], place[1] + step[1]};
    const auto from = IsCorner(place) ? At(place) : Rim(next, step);
    const auto to = IsCorner(next) ? At(next) : Rim(place, {-step[0], -step[1]});
    if (!from || !to) return std::nullopt;
    EdgeFitSettings settings{
        .reach = std::min(kMostReach, kReachInBorders * room_ * (*to - *from).norm()),
        .end_gap = EndGap(blur_)};
    if (!lens_) {
      const Edge straight(*from, *to);
      const std::optional<Bend> bend = BendOf(straight, place, step);
      settings.curved = !bend || IsLong(straight);
      settings.bend = bend.value_or(Bend());
    }
    return FitEdge(image_, lens_, *from, *to, settings);
  }

  // Those of a row or column of corners, from rim to rim. `place`: before its first corner.
  void FitLine(Place place, const Place& step, std::vector<std::optional<Edge>>& edges) const {
    const size_t first = edges.size();
    const auto next = [&](const Place& at) { return Place{at[0] + step[0], at[1] + step[1]}; };
    const Place first_corner = next(place);
    edges.push_back(Fit(place, step));
    for (place = first_corner; IsCorner(place); place = next(place)) {
      edges.push_back(Fit(place, step));
    }
    const Place last_corner = {place[0] - step[0], place[1] - step[1]};
    DropForeign(edges[first], edges[first + 1], At(first_corner));
    DropForeign(edges.back(), edges[edges.size() - 2], At(last_corner));
  }

  // Beyond the outermost corners there may be something else than the board, whose edges go
  // straight on, but for what ink and exposure move them.
  static void DropForeign(std::optional<Edge>& rim, const std::optional<Edge>& inner,
                          const std::optional<Eigen::Vector2d>& corner) {
    const bool goes_on =
        rim && inner && corner &&
        std::abs(rim->Distance(*corner) - inner->Distance(*corner)) < kMostMovedRim;
    if (!goes_on) rim.reset();
  }

  // `axis`: 1 along the rows, 0 along the columns.
  std::vector<Edge> EndingAt(const std::vector<std::optional<Edge>>& edges, const Place& at,
                             size_t axis) const {
    const int in_line = (axis == 1 ? corners_.columns : corners_.rows) + 1;
    const auto before = static_cast<size_t>(at[1 - axis] * in_line + at[axis]);
    std::vector<Edge> ending;
    for (const auto& edge : {edges[before], edges[before + 1]}) {
      if (edge) ending.push_back(*edge);
    }
    return ending;
  }

  const cv::Mat& image_;
  const std::optional<CameraModel>& lens_;
  const ChessCorners& corners_;
  double room_;
  double blur_;
  std::vector<std::optional<Edge>> along_;   // row by row, one more than corners
  std::vector<std::optional<Edge>> across_;  // column by column
};

// The mean of where the edges along and across meet, near the undistorted `at`; sigma before what
// no fit knows of.
std::optional<FittedCorner> MeanMeeting(const std::vector<Edge>& along,
                                        const std::vector<Edge>& across,
                                        const std::optional<CameraModel>& lens,
                                        const Eigen::Vector2d& at, Eigen::Vector2d& undistorted) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  double blur = 0;
  int meetings = 0;
  for (const Edge& a : along) {
    for (const Edge& b : across) {
      const auto meeting = Meet(a, b, at);
      if (!meeting) return std::nullopt;
      sum += meeting->at;
      covariance += meeting->covariance;
      blur += (a.blur() + b.blur()) / 2;
      ++meetings;
    }
  }
  if (meetings == 0) return std::nullopt;
  undistorted = sum / meetings;
  const auto pixel = Distorted(lens, undistorted);
  if (!pixel) return std::nullopt;
  const auto independent = static_cast<double>(std::min(along.size(), across.size()));
  const Eigen::Matrix2d to_pixels = UndistortedPerPixel(lens, *pixel).inverse();
  const Eigen::Matrix2d of_pixel = to_pixels * covariance * to_pixels.transpose();
  return FittedCorner{.at = *pixel,
                      .sigma = std::sqrt(of_pixel.trace() / 2 / meetings / independent),
                      .blur = blur / meetings};
}

}  // namespace

std::vector<std::optional<FittedCorner>> FitChessCorners(const cv::Mat& image,
                                                         const std::optional<CameraModel>& lens,
                                                         const ChessCorners& corners, double room) {
  ChessCorners undistorted = corners;
  for (std::optional<Eigen::Vector2d>& at : undistorted.at) {
    if (at) at = Undistorted(lens, *at);
  }
  std::vector<std::optional<FittedCorner>> fitted(corners.at.size());
  double blur = kFirstCornerBlur;
  for (int round = 0; round < kRounds; ++round) {
    const ChessEdges edges(image, lens, undistorted, room, blur);
    ChessCorners next = undistorted;
    std::vector<double> blurs;
    for (size_t i = 0; i < fitted.size(); ++i) {
      if (!undistorted.at[i]) continue;
      const std::vector<Edge> along = edges.Along(i);
      const std::vector<Edge> across = edges.Across(i);
      fitted[i] = MeanMeeting(along, across, lens, *undistorted.at[i], *next.at[i]);
      if (!fitted[i]) {
        next.at[i] = undistorted.at[i];
        continue;
      }
      blurs.push_back(fitted[i]->blur);
      const double side = edges.SideAt(i);
      fitted[i]->sigma = SigmaOf(fitted[i]->sigma, fitted[i]->blur, side * room, 0);
      if ((fitted[i]->at - *corners.at[i]).norm() >
              std::max(kMostMoved, kMostMovedInSides * side) ||
          side < kLeastSideInBlurs * fitted[i]->blur) {
        fitted[i].reset();
      }
    }
    undistorted = std::move(next);
    blur = Median(blurs, kFirstCornerBlur);
  }
  return fitted;
}

}  // namespace silhouette
