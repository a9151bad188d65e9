// SPDX-License-Identifier: Apache-2.0
// What the experiment measures, over several runs.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

namespace silhouette::calibration_experiment {

// The figures of one run, by name. What was not measured is not there.
using Figures = std::map<std::string, double>;

// A figure that the experiment knows, and the bar for its worst run.
struct Bar {
  const char* name;
  const char* meaning;
  double at_least;  // 0 where only the greatest value counts
  double at_most;
};

// All of them, in the order in which they are printed.
const std::vector<Bar>& Bars();

struct Spread {
  double median = 0;
  double worst = 0;  // the greatest; where there is a least value, the farthest from 1 by ratio
};

// Over the runs that have the figure, of which there must be one.
Spread SpreadOf(const Bar& bar, const std::vector<Figures>& runs);

bool Passes(const Bar& bar, const Spread& spread);

// The root of the mean of squares that are added up.
class RootMeanSquare {
 public:
  // `count`: of how many values `squares` is the sum.
  void Add(double squares, int count) {
    sum_ += squares;
    count_ += count;
  }
  void Add(const RootMeanSquare& other) { Add(other.sum_, other.count_); }
  int count() const { return count_; }
  double Result() const;

 private:
  double sum_ = 0;
  int count_ = 0;
};

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
  // state has it. Directions that move the pixels by less than a thirtieth of what the strongest
  // does are left out: in them the terms of a rational lens stand for each other, and errors are
  // finer than the knots of CommonField.
  ChiSquared Against(const Eigen::MatrixXd& covariance) const;

 private:
  std::vector<Eigen::Matrix<double, 2, Eigen::Dynamic>> derivatives_;
  std::vector<Eigen::Vector2d> errors_;
};

}  // namespace silhouette::calibration_experiment
