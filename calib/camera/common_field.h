// SPDX-License-Identifier: Apache-2.0
// CommonField: the error that all images of a camera have in common where its lens model lacks a
// term. A field of shifts over the image, in pixels: at knots on a grid from rim to rim they are
// independent of each other and of one variance, and bilinear in between. Each camera has 2 *
// kFieldKnots of them: x and y of each knot, row by row.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <array>
#include <functional>
#include <optional>
#include <vector>

namespace silhouette {

inline constexpr int kFieldColumns = 7;
inline constexpr int kFieldRows = 6;
inline constexpr int kFieldKnots = kFieldColumns * kFieldRows;

// By how much a knot's shift moves a pixel.
struct KnotShare {
  int knot = 0;
  double share = 0;
};
std::array<KnotShare, 4> KnotsAt(const Eigen::Vector2d& pixel, int width, int height);

// A least-squares solve at its minimum. With J the derivatives of the residuals by its state, C =
// (J'J)^-1.
struct SolvedResiduals {
  using Rows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  Rows by_state;  // J
  Rows by_field;  // the derivatives of the measurements, as weighted, by the fields' shifts
  Eigen::VectorXd residuals;
  double variance = 1;  // of the residuals by errors that no field has
  // Rows whose errors may depend on each other in ways that are not the field's: of an image, or of
  // a pose. Rows of none do not count.
  std::vector<std::vector<int>> clusters;
  // C X of any X; and the trace of X'C X where X has rows of the cluster's states only.
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd& x)> covariance_times;
  std::function<double(size_t cluster, const Eigen::MatrixXd& x)> trace;
};

struct FoundField {
  double sigma = 0;        // of a shift, pixels
  Eigen::MatrixXd motion;  // of the state by the shifts
};
// From what the residuals of different clusters have in common; nothing if that may be chance.
std::optional<FoundField> FindCommonField(const SolvedResiduals& solved);

}  // namespace silhouette
