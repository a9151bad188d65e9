// Errors that have common causes, judged together: whether they are as large as was predicted.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace silhouette::calibration_experiment {

// A sum of squares of standardised, independent errors, and of how many: of the mean 1 each, with a
// standard deviation of the root of 2 / freedom, if the prediction is right.
struct ChiSquared {
  double squares = 0;
  int freedom = 0;

  void Add(const ChiSquared& other);
  double PerFreedom() const;  // 0 of none is 0
};

// Errors of pixels that follow from the errors of one state, to first order.
class JointErrors {
 public:
  // `derivative`: of the pixel by the state. `error`: of the pixel.
  void Add(const Eigen::Matrix<double, 2, Eigen::Dynamic>& derivative,
           const Eigen::Vector2d& error);

  // The errors by directions in which they are independent of each other, as `covariance` of the
  // state has it. Directions that move the pixels by less than a thousandth of what the strongest
  // does are left out: in them the terms of a rational lens stand for each other.
  ChiSquared Against(const Eigen::MatrixXd& covariance) const;

 private:
  std::vector<Eigen::Matrix<double, 2, Eigen::Dynamic>> derivatives_;
  std::vector<Eigen::Vector2d> errors_;
};

}  // namespace silhouette::calibration_experiment
