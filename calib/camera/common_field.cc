// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/common_field.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace silhouette {

std::array<KnotShare, 4> KnotsAt(const Eigen::Vector2d& pixel, int width, int height) {
  const double x = std::clamp((pixel.x() + 0.5) / width, 0.0, 1.0) * (kFieldColumns - 1);
  const double y = std::clamp((pixel.y() + 0.5) / height, 0.0, 1.0) * (kFieldRows - 1);
  const int column = std::min(static_cast<int>(x), kFieldColumns - 2);
  const int row = std::min(static_cast<int>(y), kFieldRows - 2);
  const int knot = row * kFieldColumns + column;
  const double right = x - column;
  const double down = y - row;
  return {{{knot, (1 - right) * (1 - down)},
           {knot + 1, right * (1 - down)},
           {knot + kFieldColumns, (1 - right) * down},
           {knot + kFieldColumns + 1, right * down}}};
}

std::optional<FoundField> FindCommonField(const SolvedResiduals& solved) {
  constexpr double kChance = 4;  // standard deviations
  FoundField found;
  found.motion = solved.covariance_times(solved.by_state.transpose() * solved.by_field);
  const Eigen::Index shifts = solved.by_field.cols();
  // By which the residuals move with the shifts, once the solve has followed, is W; per cluster:
  // W'r, W'W, and what it has of the residuals' noise. The sums, and those of squared norms.
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(shifts);
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(shifts, shifts);
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(shifts, shifts);
  double own_pull = 0;
  double own_products = 0;
  double own_squares = 0;
  double followed = 0;
  for (size_t c = 0; c < solved.clusters.size(); ++c) {
    const std::vector<int>& rows = solved.clusters[c];
    Eigen::MatrixXd w(std::ssize(rows), shifts);
    Eigen::VectorXd r(std::ssize(rows));
    Eigen::MatrixXd by_state = Eigen::MatrixXd::Zero(solved.by_state.cols(), shifts);
    for (Eigen::Index i = 0; i < std::ssize(rows); ++i) {
      const int row = rows[static_cast<size_t>(i)];
      r[i] = solved.residuals[row];
      w.row(i) = -solved.by_state.row(row) * found.motion;
      for (SolvedResiduals::Rows::InnerIterator entry(solved.by_field, row); entry; ++entry) {
        w(i, entry.col()) += entry.value();
      }
      for (SolvedResiduals::Rows::InnerIterator entry(solved.by_state, row); entry; ++entry) {
        by_state.row(entry.col()) += entry.value() * w.row(i);
      }
    }
    const Eigen::VectorXd own = w.transpose() * r;
    const Eigen::MatrixXd of_own = w.transpose() * w;
    pull += own;
    products += own * own.transpose();
    squares += of_own;
    own_pull += own.squaredNorm();
    own_products += own.squaredNorm() * own.squaredNorm();
    own_squares += of_own.squaredNorm();
    followed += solved.trace(c, by_state);
  }
  const double excess = pull.squaredNorm() - own_pull - solved.variance * followed;
  const double chance = std::sqrt(std::max(0.0, 2 * (products.squaredNorm() - own_products)));
  const double expected = squares.squaredNorm() - own_squares;
  fprintf(stderr, "FIELD z %.2f sigma %.4f noise %.4f\n", excess / chance, std::sqrt(std::max(0.0,excess / expected)), solved.variance);
  if (!(expected > 0) || !(excess > kChance * chance)) return std::nullopt;
  found.sigma = std::sqrt(excess / expected);
  return found;
}

}  // namespace silhouette
