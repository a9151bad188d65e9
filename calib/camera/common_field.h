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
std::array<KnotShare, 4> KnotsAt(const Eigen::Vector2d& pixel, int width, int height,
                                 int columns = kFieldColumns, int rows = kFieldRows);

// A least-squares solve at its minimum. With J the derivatives of the residuals by its state, C =
// (J'J)^-1.
struct SolvedResiduals {
  using Rows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  Rows by_state;  // J
  Rows by_field;  // the derivatives of the measurements, as weighted, by the fields' shifts
  Eigen::VectorXd residuals;
  // Rows whose errors may depend on each other in ways that are not the common field's: of the
  // images of a placing. Rows of none do not count.
  std::vector<std::vector<int>> clusters;
  // C X of any X; and some Y with Y'Y = X'C X where X has rows of the cluster's states only.
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd& x)> covariance_times;
  std::function<Eigen::MatrixXd(size_t cluster, const Eigen::MatrixXd& x)> root_times;
};

// OwnFields: the errors that the corners of one image have in common, as by blur, time or print:
// a field like CommonField, but drawn again for each image.
struct OwnFields {
  double noise = 0;  // variance of the residuals by errors that are independent of each other
  double sigma = 0;  // of a shift, pixels
  // J'F of each cluster, with F its rows of by_field: by which its fields pull the state.
  std::vector<Eigen::SparseMatrix<double>> pulls;
};
// Variance components by the method of moments (Henderson, Biometrics 9, 1953): noise and shifts
// are as large as the squares of the residuals, and of F'r summed over clusters, are expected to
// be. `freedom`: of the residuals.
OwnFields FindOwnFields(const SolvedResiduals& solved, int freedom);

struct FoundField {
  double sigma = 0;        // of a shift, pixels
  Eigen::MatrixXd motion;  // of the state by the shifts
};
// From what the residuals of different clusters have in common; nothing if that may be chance.
// `own`: the errors of each residual and image by themselves.
std::optional<FoundField> FindCommonField(const SolvedResiduals& solved, const OwnFields& own);

}  // namespace silhouette
