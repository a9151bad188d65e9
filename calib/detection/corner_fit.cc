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
constexpr double kReachInModules = 0.55;
constexpr double kMostMoved = 1.5;  // pixels, of a corner by the fit
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

// As TagDetector does not fit narrower modules.
constexpr double kLeastSideInBlurs = 3.5;

double SigmaOf(double of_fit, double blur, double module) {
  const double neighbours = kNeighbourSigma * std::pow(kNeighbourRatio * blur / module, 5);
  return std::hypot(kOfFit * of_fit, neighbours, kLeastSigma);
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
                                          const PixelCorners& undistorted, double module,
                                          double blur) {
  EdgeFitSettings settings;
  settings.reach = std::min(kMostReach, kReachInModules * module);
  settings.end_gap = std::max(2.0, 1 + 2 * blur);
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
                                        const PixelCorners& corners, double module) {
  PixelCorners undistorted;
  for (int i = 0; i < 4; ++i) {
    const auto at = Undistorted(lens, corners[i]);
    if (!at) return std::nullopt;
    undistorted[i] = *at;
  }
  FittedCorners fitted;
  fitted.blur = kFirstCornerBlur;
  for (int round = 0; round < kRounds; ++round) {
    const auto edges = FitEdges(image, lens, undistorted, module, fitted.blur);
    if (!edges) return std::nullopt;
    double variance = 0;
    fitted.blur = fitted.contrast = 0;
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
    }
    fitted.sigma = std::sqrt(variance);
  }
  fitted.sigma = SigmaOf(fitted.sigma, fitted.blur, module);
  return fitted;
}

namespace {

// The edges of a chessboard between neighbouring corners, in undistorted pixels.
class ChessEdges {
 public:
  ChessEdges(const cv::Mat& image, const std::optional<CameraModel>& lens,
             const ChessCorners& corners, double room, double blur)
      : columns_(corners.columns), right_(corners.at.size()), down_(corners.at.size()) {
    for (size_t i = 0; i < corners.at.size(); ++i) {
      const bool last = (i + 1) % static_cast<size_t>(columns_) == 0;
      const size_t below = i + static_cast<size_t>(columns_);
      const auto fit = [&](size_t to) {
        return corners.at[i] && corners.at[to]
                   ? Fit(image, lens, *corners.at[i], *corners.at[to], room, blur)
                   : std::nullopt;
      };
      if (!last) right_[i] = fit(i + 1);
      if (below < corners.at.size()) down_[i] = fit(below);
    }
  }

  // Those that end at a corner, along its row or its column.
  std::vector<Edge> Along(size_t corner) const {
    const bool first = corner % static_cast<size_t>(columns_) == 0;
    return There(right_[corner], first ? std::nullopt : right_[corner - 1]);
  }
  std::vector<Edge> Across(size_t corner) const {
    const auto columns = static_cast<size_t>(columns_);
    return There(down_[corner], corner < columns ? std::nullopt : down_[corner - columns]);
  }

 private:
  static std::optional<Edge> Fit(const cv::Mat& image, const std::optional<CameraModel>& lens,
                                 const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                                 double room, double blur) {
    return FitEdge(image, lens, from, to,
                   {.reach = std::min(kMostReach, kReachInModules * room * (to - from).norm()),
                    .end_gap = std::max(2.0, 1 + 2 * blur),
                    .curved = !lens});
  }

  static std::vector<Edge> There(const std::optional<Edge>& a, const std::optional<Edge>& b) {
    std::vector<Edge> edges;
    if (a) edges.push_back(*a);
    if (b) edges.push_back(*b);
    return edges;
  }

  int columns_;
  std::vector<std::optional<Edge>> right_;
  std::vector<std::optional<Edge>> down_;
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
      double side = std::numeric_limits<double>::infinity();
      for (const Edge& edge : along) side = std::min(side, edge.length());
      for (const Edge& edge : across) side = std::min(side, edge.length());
      fitted[i]->sigma = SigmaOf(fitted[i]->sigma, fitted[i]->blur, side * room);
      if ((fitted[i]->at - *corners.at[i]).norm() > kMostMoved ||
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
