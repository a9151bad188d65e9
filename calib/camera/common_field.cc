// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/common_field.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

namespace silhouette {
namespace {

using Rows = SolvedResiduals::Rows;

Rows RowsOf(const Rows& all, const std::vector<int>& rows) {
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t i = 0; i < rows.size(); ++i) {
    for (Rows::InnerIterator entry(all, rows[i]); entry; ++entry) {
      entries.emplace_back(static_cast<int>(i), entry.col(), entry.value());
    }
  }
  Rows some(std::ssize(rows), all.cols());
  some.setFromTriplets(entries.begin(), entries.end());
  return some;
}

// Leaves out the columns without an entry; returns which were kept.
std::vector<int> GatherColumns(Rows& matrix) {
  std::map<int, int> places;
  std::vector<Eigen::Triplet<double>> entries;
  for (int row = 0; row < matrix.rows(); ++row) {
    for (Rows::InnerIterator entry(matrix, row); entry; ++entry) {
      places[static_cast<int>(entry.col())] = 0;
    }
  }
  std::vector<int> kept;
  for (auto& [column, place] : places) {
    place = static_cast<int>(kept.size());
    kept.push_back(column);
  }
  for (int row = 0; row < matrix.rows(); ++row) {
    for (Rows::InnerIterator entry(matrix, row); entry; ++entry) {
      entries.emplace_back(row, places[static_cast<int>(entry.col())], entry.value());
    }
  }
  matrix.resize(matrix.rows(), std::ssize(kept));
  matrix.setFromTriplets(entries.begin(), entries.end());
  return kept;
}

}  // namespace

std::array<KnotShare, 4> KnotsAt(const Eigen::Vector2d& pixel, int width, int height, int columns,
                                 int rows) {
  const double x = std::clamp((pixel.x() + 0.5) / width, 0.0, 1.0) * (columns - 1);
  const double y = std::clamp((pixel.y() + 0.5) / height, 0.0, 1.0) * (rows - 1);
  const int column = std::min(static_cast<int>(x), columns - 2);
  const int row = std::min(static_cast<int>(y), rows - 2);
  const int knot = row * columns + column;
  const double right = x - column;
  const double down = y - row;
  return {{{knot, (1 - right) * (1 - down)},
           {knot + 1, right * (1 - down)},
           {knot + columns, (1 - right) * down},
           {knot + columns + 1, right * down}}};
}

OwnFields FindOwnFields(const SolvedResiduals& solved, int freedom) {
  OwnFields found;
  // With H = J C J': F'r, and F'(I - H)F of each cluster.
  double squares = 0;
  double pulls = 0;
  double trace = 0;
  double norms = 0;
  for (size_t c = 0; c < solved.clusters.size(); ++c) {
    const Rows state = RowsOf(solved.by_state, solved.clusters[c]);
    const Rows field = RowsOf(solved.by_field, solved.clusters[c]);
    const Eigen::VectorXd r = solved.residuals(solved.clusters[c]);
    found.pulls.emplace_back(state.transpose() * field);
    const Eigen::MatrixXd followed = solved.root_times(c, Eigen::MatrixXd(found.pulls.back()));
    const Eigen::MatrixXd left =
        Eigen::MatrixXd(field.transpose() * field) - followed.transpose() * followed;
    squares += r.squaredNorm();
    pulls += (field.transpose() * r).squaredNorm();
    trace += left.trace();
    norms += left.squaredNorm();
  }
  // squares = freedom * noise + trace * shifts; pulls = trace * noise + norms * shifts.
  const double determined = freedom * norms - trace * trace;
  const double shifts =
      determined > 0 ? std::max(0.0, (freedom * pulls - trace * squares) / determined) : 0;
  found.noise = std::max(0.0, (squares - trace * shifts) / freedom);
  found.sigma = std::sqrt(shifts);
  return found;
}

std::optional<FoundField> FindCommonField(const SolvedResiduals& solved, const OwnFields& own) {
  constexpr double kChance = 4;  // standard deviations
  FoundField found;
  found.motion = solved.covariance_times(solved.by_state.transpose() * solved.by_field);
  const Eigen::Index shifts = solved.by_field.cols();
  // By which the residuals move with the shifts, once the solve has followed, is W; per cluster:
  // W'r, W'W, and what it has of the residuals' noise. The sums, and those of squared norms.
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(shifts);
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(shifts, shifts);
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(shifts, shifts);
  double own_pulls = 0;
  double own_products = 0;
  double own_squares = 0;
  double followed = 0;
  double followed_own = 0;
  for (size_t c = 0; c < solved.clusters.size(); ++c) {
    // Of the cluster's few states: J'F, J'J, J'r, and their motion.
    Rows state = RowsOf(solved.by_state, solved.clusters[c]);
    const Rows field = RowsOf(solved.by_field, solved.clusters[c]);
    const Eigen::VectorXd r = solved.residuals(solved.clusters[c]);
    const std::vector<int> states = GatherColumns(state);
    const Eigen::MatrixXd motion = found.motion(states, Eigen::all);
    const Eigen::MatrixXd by_field = state.transpose() * field;
    const Eigen::MatrixXd followed_by = Eigen::MatrixXd(state.transpose() * state) * motion;
    const Eigen::MatrixXd half = motion.transpose() * (by_field - followed_by / 2);
    const Eigen::MatrixXd of_own =
        Eigen::MatrixXd(field.transpose() * field) - half - half.transpose();
    const Eigen::VectorXd own_pull =
        field.transpose() * r - motion.transpose() * (state.transpose() * r);
    Eigen::MatrixXd by_state = Eigen::MatrixXd::Zero(solved.by_state.cols(), shifts);
    by_state(states, Eigen::all) = by_field - followed_by;
    pull += own_pull;
    products += own_pull * own_pull.transpose();
    squares += of_own;
    own_pulls += own_pull.squaredNorm();
    own_products += own_pull.squaredNorm() * own_pull.squaredNorm();
    own_squares += of_own.squaredNorm();
    const Eigen::MatrixXd root = solved.root_times(c, by_state);
    followed += own.noise * root.squaredNorm();
    if (!(own.sigma > 0)) continue;
    const Eigen::MatrixXd by_own =
        Eigen::MatrixXd(field.transpose() * field) - by_field.transpose() * motion;
    const Eigen::MatrixXd left =
        by_own - solved.root_times(c, Eigen::MatrixXd(own.pulls[c])).transpose() * root;
    followed_own += by_own.squaredNorm() - left.squaredNorm();
  }
  const double excess =
      pull.squaredNorm() - own_pulls - followed - own.sigma * own.sigma * followed_own;
  const double chance = std::sqrt(std::max(0.0, 2 * (products.squaredNorm() - own_products)));
  // The own fields were found with the common one in them.
  const double expected = squares.squaredNorm() - own_squares - followed_own;
  if (!(expected > 0) || !(excess > kChance * chance)) return std::nullopt;
  found.sigma = std::sqrt(excess / expected);
  return found;
}

}  // namespace silhouette
