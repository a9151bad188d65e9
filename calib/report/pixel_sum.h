// Sums of squares, per axis of the image.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace silhouette {

class PixelSum {
 public:
  void Add(const Eigen::Vector2d& error) { Add(error.squaredNorm() / 2); }
  // `square`: per axis.
  void Add(double square) {
    sum_ += square;
    ++count_;
  }
  int count() const { return count_; }
  double Rms() const { return count_ > 0 ? std::sqrt(sum_ / count_) : 0; }

 private:
  double sum_ = 0;
  int count_ = 0;
};

}  // namespace silhouette
