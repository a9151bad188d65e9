#include "tools/silhouette-experiments/calibration/joint_errors.h"

#include <Eigen/Eigenvalues>

namespace silhouette::calibration_experiment {
namespace {

// Of the strongest direction's variance.
constexpr double kLeastVariance = 1e-6;

}  // namespace

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
