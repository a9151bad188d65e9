// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/figures.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace silhouette::calibration_experiment {
namespace {

// Of the strongest direction's variance.
constexpr double kLeastVariance = 1e-3;

}  // namespace

const std::vector<Bar>& Bars() {
  static const std::vector<Bar> bars = {
      {"corner_px", "corners of tags of 60 px and more, rms per axis, lens unknown", 0, 0.03},
      {"workspace_px", "80 boards: projection of workspace points, rms; worst of 16", 0, 0.04},
      {"chi2_per_dof", "of the errors predicted for them, over 16 calibrations", 0.8, 1.25},
      {"flange_mm", "flange tag, 30 poses: place of a camera, rms", 0, 0.85},
      {"flange_deg", "its direction, rms", 0, 0.022},
      {"workspace_mm", "workspace points as such a camera sees them, rms", 0, 0.4},
      {"epipolar_px", "corners held out, from their lines, rms", 0, 0.05},
      {"weak_epipolar_px", "the same of matrices straight from corners, no lens bowed", 0, 0.05},
      {"band_misses", "of a million points, outside the bands of 64 x 64 masks", 0, 0},
      {"roundtrip_px", "written to a file and read again, greatest", 0, 1e-9},
      {"seconds", "solving for 4 cameras and 80 boards; worst of 16", 0, 10},
  };
  return bars;
}

Spread SpreadOf(const Bar& bar, const std::vector<Figures>& runs) {
  std::vector<double> values;
  for (const Figures& run : runs) {
    if (const auto found = run.find(bar.name); found != run.end()) values.push_back(found->second);
  }
  std::sort(values.begin(), values.end());
  const size_t half = values.size() / 2;
  Spread spread;
  spread.median = values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
  spread.worst = values.back();
  if (bar.at_least > 0 && values.front() > 0 && 1 / values.front() > values.back()) {
    spread.worst = values.front();
  }
  return spread;
}

bool Passes(const Bar& bar, const Spread& spread) {
  return spread.worst >= bar.at_least && spread.worst <= bar.at_most;
}

double RootMeanSquare::Result() const { return count_ == 0 ? 0 : std::sqrt(sum_ / count_); }

void ChiSquared::Add(const ChiSquared& other) {
  squares += other.squares;
  freedom += other.freedom;
}

double ChiSquared::PerFreedom() const { return freedom == 0 ? 0 : squares / freedom; }

void JointErrors::Add(const Eigen::Matrix<double, 2, Eigen::Dynamic>& derivative,
                      const Eigen::Vector2d& error) {
  derivatives_.push_back(derivative);
  errors_.push_back(error);
}

ChiSquared JointErrors::Against(const Eigen::MatrixXd& covariance) const {
  // With a root L of the state's covariance and the derivatives J, the covariance of all pixels is
  // (J L)(J L)'. It is large, but of no greater rank than the state's: (J L)'(J L) has the same
  // variances.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> state(covariance);
  const Eigen::MatrixXd root =
      state.eigenvectors() * state.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(covariance.rows(), covariance.cols());
  Eigen::VectorXd along = Eigen::VectorXd::Zero(covariance.rows());
  for (size_t i = 0; i < errors_.size(); ++i) {
    const Eigen::MatrixXd derivative = derivatives_[i] * root;
    squares += derivative.transpose() * derivative;
    along += derivative.transpose() * errors_[i];
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> pixels(squares);
  const Eigen::VectorXd& variances = pixels.eigenvalues();  // ascending
  ChiSquared result;
  for (Eigen::Index i = 0; i < variances.size(); ++i) {
    if (!(variances[i] > kLeastVariance * variances[variances.size() - 1])) continue;
    const double standardised = pixels.eigenvectors().col(i).dot(along) / variances[i];
    result.Add({.squares = standardised * standardised, .freedom = 1});
  }
  return result;
}

}  // namespace silhouette::calibration_experiment
