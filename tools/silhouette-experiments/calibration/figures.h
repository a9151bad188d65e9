// What the experiment measures, over several runs.
#pragma once

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

}  // namespace silhouette::calibration_experiment
