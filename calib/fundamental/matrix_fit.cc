// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/matrix_fit.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <unsupported/Eigen/NonLinearOptimization>

#include "calib/fundamental/epipolar_geometry.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

Eigen::Matrix3d Turn(const Eigen::Vector3d& by) {
  const double angle = by.norm();
  if (!(angle > 0)) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, by / angle).toRotationMatrix();
}

}  // namespace

Eigen::Matrix3d NormalisingOf(std::span<const Correspondence> corners,
                              Eigen::Vector2d Correspondence::*point) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Correspondence& corner : corners) mean += corner.*point;
  mean /= static_cast<double>(corners.size());
  double length = 0;
  for (const Correspondence& corner : corners) length += (corner.*point - mean).norm();
  const double scale =
      std::sqrt(2.0) * static_cast<double>(corners.size()) / std::max(length, 1e-9);
  Eigen::Matrix3d normalising;
  normalising << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return normalising;
}

MatrixChart::MatrixChart(const Eigen::Matrix3d& f, const Eigen::Matrix3d& normal_a,
                         const Eigen::Matrix3d& normal_b)
    : normal_a_(normal_a), normal_b_(normal_b) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      normal_b.inverse().transpose() * f * normal_a.inverse(),
      Eigen::ComputeFullU | Eigen::ComputeFullV);
  u_ = svd.matrixU();
  v_ = svd.matrixV();
  ratio_ = std::atan2(svd.singularValues()[1], svd.singularValues()[0]);
}

Eigen::Matrix3d MatrixChart::At(const Freedoms& p) const {
  const double ratio = ratio_ + p[6];
  const Eigen::Vector3d values(std::cos(ratio), std::sin(ratio), 0);
  const Eigen::Matrix3d normal =
      u_ * Turn(p.head<3>()) * values.asDiagonal() * (v_ * Turn(p.segment<3>(3))).transpose();
  return normal_b_.transpose() * normal * normal_a_;
}

std::array<Eigen::Matrix3d, kMatrixFreedoms> MatrixChart::SlopesAt(const Freedoms& p) const {
  constexpr double kStep = 1e-6;
  std::array<Eigen::Matrix3d, kMatrixFreedoms> slopes;
  for (int k = 0; k < kMatrixFreedoms; ++k) {
    Freedoms more = p;
    Freedoms less = p;
    more[k] += kStep;
    less[k] -= kStep;
    slopes[static_cast<size_t>(k)] = (At(more) - At(less)) / (2 * kStep);
  }
  return slopes;
}

namespace {

using Freedoms = MatrixChart::Freedoms;

// Sampson's distances of all corners, as Eigen's minimiser asks for them.
struct MatrixFitDistances : CornerFunction {
  int inputs() const { return kMatrixFreedoms; }

  int operator()(const Freedoms& p, Eigen::VectorXd& distances) const {
    const Eigen::Matrix3d f = chart.At(p);
    for (size_t i = 0; i < corners.size(); ++i) {
      const Correspondence& c = corners[i];
      distances[static_cast<Eigen::Index>(i)] = SampsonDistance(f, c.a, c.sigma_a, c.b, c.sigma_b);
    }
    return 0;
  }

  int df(const Freedoms& p, Eigen::MatrixXd& jacobian) const {
    const Eigen::Matrix3d f = chart.At(p);
    const auto slopes = chart.SlopesAt(p);
    for (size_t i = 0; i < corners.size(); ++i) {
      const Correspondence& c = corners[i];
      const Eigen::Vector3d a = c.a.homogeneous();
      const Eigen::Vector3d b = c.b.homogeneous();
      const Eigen::Vector2d line_a = c.sigma_a * (f.transpose() * b).head<2>();
      const Eigen::Vector2d line_b = c.sigma_b * (f * a).head<2>();
      const double length = std::sqrt(line_a.squaredNorm() + line_b.squaredNorm());
      const double distance = b.dot(f * a) / length;
      for (size_t k = 0; k < slopes.size(); ++k) {
        const Eigen::Vector3d slope_b = slopes[k] * a;
        const Eigen::Vector3d slope_a = slopes[k].transpose() * b;
        const double longer = (c.sigma_a * line_a.dot(slope_a.head<2>()) +
                               c.sigma_b * line_b.dot(slope_b.head<2>())) /
                              length;
        jacobian(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
            (b.dot(slope_b) - distance * longer) / length;
      }
    }
    return 0;
  }
};

// Of a symmetric matrix without negative eigenvalues.
Eigen::MatrixXd PseudoInverse(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  const double least = static_cast<double>(matrix.rows()) * std::numeric_limits<double>::epsilon() *
                       solver.eigenvalues().maxCoeff();
  const Eigen::VectorXd inverse =
      solver.eigenvalues().unaryExpr([&](double value) { return value > least ? 1 / value : 0; });
  return solver.eigenvectors() * inverse.asDiagonal() * solver.eigenvectors().transpose();
}

}  // namespace

double MatrixFit::MarginDeviation(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  const Eigen::Vector3d x = a.homogeneous();
  const Eigen::Vector3d y = b.homogeneous();
  Eigen::Matrix<double, kMatrixFreedoms, 1> slope;
  for (int k = 0; k < kMatrixFreedoms; ++k) slope[k] = y.dot(slopes[static_cast<size_t>(k)] * x);
  const double steepness = (f * x).head<2>().norm() + (f.transpose() * y).head<2>().norm();
  return std::sqrt(std::max(0.0, slope.dot(covariance * slope))) / steepness;
}

Eigen::Matrix3d EightPoints(std::span<const Correspondence> corners) {
  const Eigen::Matrix3d normal_a = NormalisingOf(corners, &Correspondence::a);
  const Eigen::Matrix3d normal_b = NormalisingOf(corners, &Correspondence::b);
  Eigen::Matrix<double, 9, 9> squares = Eigen::Matrix<double, 9, 9>::Zero();
  for (const Correspondence& corner : corners) {
    const Eigen::Vector3d a = normal_a * corner.a.homogeneous();
    const Eigen::Vector3d b = normal_b * corner.b.homogeneous();
    Eigen::Matrix<double, 9, 1> row;
    row << b.x() * a, b.y() * a, b.z() * a;
    squares.selfadjointView<Eigen::Lower>().rankUpdate(row);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(squares);
  const Eigen::Matrix<double, 9, 1> least = solver.eigenvectors().col(0);
  Eigen::Matrix3d normal;
  normal << least.head<3>().transpose(), least.segment<3>(3).transpose(),
      least.tail<3>().transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(normal, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d values = svd.singularValues();
  values[2] = 0;
  const Eigen::Matrix3d f = normal_b.transpose() * svd.matrixU() * values.asDiagonal() *
                            svd.matrixV().transpose() * normal_a;
  return f / f.norm();
}

MatrixFit Refined(const Eigen::Matrix3d& start, std::span<const Correspondence> corners) {
  const MatrixChart chart(start, NormalisingOf(corners, &Correspondence::a),
                          NormalisingOf(corners, &Correspondence::b));
  MatrixFitDistances distances{{chart, corners}};
  Freedoms p = Freedoms::Zero(kMatrixFreedoms);
  Eigen::LevenbergMarquardt<MatrixFitDistances> minimiser(distances);
  minimiser.parameters.maxfev = 200;
  minimiser.minimize(p);

  Eigen::MatrixXd jacobian(distances.values(), kMatrixFreedoms);
  distances.df(p, jacobian);
  MatrixFit fit{.f = chart.At(p), .slopes = chart.SlopesAt(p), .covariance = {}};
  const MatrixCovariance information = jacobian.transpose() * jacobian;
  fit.covariance = PseudoInverse(information);
  const double norm = fit.f.norm();
  fit.f /= norm;
  for (Eigen::Matrix3d& slope : fit.slopes) slope /= norm;
  return fit;
}

namespace {

constexpr int kSample = 8;
constexpr int kMostSamples = 2000;
constexpr double kSure = 1e-4;  // probability that no sample was free of wrong corners
// A corner is wrong at first if it is further off than this: the greater of pixels (lenses bow
// lines, eight points are few) and standard deviations.
constexpr double kRoughPixels = 2;
constexpr double kRough = 10;
constexpr double kBelieved = 4;  // standard deviations

double Distance(const Eigen::Matrix3d& f, const Correspondence& c) {
  return std::abs(SampsonDistance(f, c.a, c.sigma_a, c.b, c.sigma_b));
}

double RoughLimit(const Correspondence& c) {
  return std::max(kRough, kRoughPixels / std::max(c.sigma_a, c.sigma_b));
}

template <typename Limit>
std::vector<bool> Within(std::span<const Correspondence> corners, const Eigen::Matrix3d& f,
                         const Limit& limit) {
  std::vector<bool> within(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) {
    within[i] = Distance(f, corners[i]) < limit(corners[i]);
  }
  return within;
}

int CountOf(const std::vector<bool>& which) {
  return static_cast<int>(std::ranges::count(which, true));
}

// Eight corners, of as many tags as there are.
std::vector<Correspondence> Sample(std::span<const Correspondence> corners, std::mt19937& random) {
  std::vector<Correspondence> sample;
  std::uniform_int_distribution<size_t> any(0, corners.size() - 1);
  for (int attempt = 0; sample.size() < kSample; ++attempt) {
    const Correspondence& corner = corners[any(random)];
    const bool taken = std::ranges::any_of(sample, [&](const Correspondence& other) {
      return attempt < 4 * kSample ? other.tag == corner.tag : other.a == corner.a;
    });
    if (!taken) sample.push_back(corner);
  }
  return sample;
}

// How badly a matrix fits: a wrong corner counts as one at its limit.
double Cost(std::span<const Correspondence> corners, const Eigen::Matrix3d& f) {
  double cost = 0;
  for (const Correspondence& corner : corners) {
    const double share = Distance(f, corner) / RoughLimit(corner);
    cost += share < 1 ? share * share : 1;  // not a number: wrong
  }
  return cost;
}

// The corners that agree with the best of many samples.
std::vector<bool> Agreeing(std::span<const Correspondence> corners, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<bool> best(corners.size());
  double least = static_cast<double>(corners.size());
  double needed = kMostSamples;
  for (int i = 0; i < kMostSamples && i < needed; ++i) {
    Eigen::Matrix3d f = EightPoints(Sample(corners, random));
    if (!f.allFinite() || !(Cost(corners, f) < least)) continue;
    // A matrix of all that agree is better than that of eight of them.
    const std::vector<Correspondence> agreeing = Chosen(corners, Within(corners, f, RoughLimit));
    if (agreeing.size() < kSample) continue;
    const Eigen::Matrix3d of_all = EightPoints(agreeing);
    if (Cost(corners, of_all) < Cost(corners, f)) f = of_all;
    least = Cost(corners, f);
    best = Within(corners, f, RoughLimit);
    const double share = static_cast<double>(CountOf(best)) / static_cast<double>(corners.size());
    const double clean = std::min(std::pow(share, kSample), 1 - 1e-12);
    needed = 20 + std::log(kSure) / std::log(1 - clean);
  }
  return best;
}

// Root mean square of the distances of those that were believed, and of the middle of all as if
// they were normal: few that are wrong do not widen it.
double MedianSpread(std::span<const Correspondence> corners, const Eigen::Matrix3d& f) {
  std::vector<double> distances;
  for (const Correspondence& corner : corners) distances.push_back(Distance(f, corner));
  return 1.4826 * Median(std::move(distances));
}

}  // namespace

std::optional<RobustFit> FitMatrix(std::span<const Correspondence> corners, uint32_t seed) {
  constexpr int kRounds = 10;
  if (corners.size() < kSample) return std::nullopt;
  RobustFit result;
  result.fits = Agreeing(corners, seed);
  if (2 * CountOf(result.fits) < static_cast<int>(corners.size())) return std::nullopt;
  result.roughly = result.fits;
  Eigen::Matrix3d start = EightPoints(Chosen(corners, result.fits));
  for (int round = 0; round < kRounds; ++round) {
    result.fit = Refined(start, Chosen(corners, result.fits));
    start = result.fit.f;
    if (!start.allFinite()) return std::nullopt;
    const double limit = kBelieved * std::max(1.0, MedianSpread(corners, start));
    std::vector<bool> within = Within(corners, start, [&](const Correspondence&) { return limit; });
    if (CountOf(within) < kSample) return std::nullopt;
    if (within == result.fits) break;
    result.fits = std::move(within);
  }
  double squares = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (!result.fits[i]) continue;
    ++result.believed;
    const double distance = Distance(result.fit.f, corners[i]);
    squares += distance * distance;
  }
  result.spread = std::sqrt(squares / std::max(1, result.believed - kMatrixFreedoms));
  return result;
}

}  // namespace silhouette
