// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/corner_fit.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

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
  const double neighbours = kNeighbourSigma * std::pow(kNeighbourRatio * fitted.blur / module, 5);
  fitted.sigma = std::hypot(kOfFit * fitted.sigma, neighbours, kLeastSigma);
  return fitted;
}

}  // namespace silhouette
