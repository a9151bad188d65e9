// Where a straight edge between dark and bright lies in an image, to some hundredths of a pixel:
// a blurred step is fitted to the grey values of all pixels beside it.
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/detection/lens.h"

namespace silhouette {

// An edge in undistorted pixels: at `along`, from -1 to 1 on the way from one end to the other, it
// is `offset(along)` pixels to the side of the straight line through both ends.
class Edge {
 public:
  Edge(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

  double Along(const Eigen::Vector2d& at) const { return tangent_.dot(at - middle_) / half_; }
  double Offset(double along) const { return shape_[0] + along * (shape_[1] + along * shape_[2]); }
  // How far `at` is from the edge, positive on the side of normal().
  double Distance(const Eigen::Vector2d& at) const {
    return normal().dot(at - middle_) - Offset(Along(at));
  }
  // Of Distance, with respect to `at`.
  Eigen::Vector2d Gradient(const Eigen::Vector2d& at) const;
  // The variance of Offset(along).
  double Variance(double along) const;

  double length() const { return 2 * half_; }
  const Eigen::Vector2d& middle() const { return middle_; }
  const Eigen::Vector2d& tangent() const { return tangent_; }
  Eigen::Vector2d normal() const { return {-tangent_.y(), tangent_.x()}; }
  double blur() const { return blur_; }  // standard deviation of its blur, with a pixel's own width
  double contrast() const { return contrast_; }  // grey levels from one side to the other
  double noise() const { return noise_; }        // of a grey value about the fit

 private:
  friend class EdgeFitter;

  Eigen::Vector2d middle_;
  Eigen::Vector2d tangent_;
  double half_;
  Eigen::Vector3d shape_ = Eigen::Vector3d::Zero();  // of Offset: constant, linear, quadratic
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  double blur_ = 0;
  double contrast_ = 0;
  double noise_ = 0;
};

struct EdgeFitSettings {
  double reach = 4;     // pixels to either side that are looked at
  double end_gap = 3;   // pixels left out at both ends, where the next edge begins
  bool curved = false;  // the edge may be a parabola
};

// The edge near the straight line between two undistorted positions. `image`: CV_8UC1. Nothing if
// there is none: too few pixels in the image, no contrast, or the fit does not settle.
std::optional<Edge> FitEdge(const cv::Mat& image, const Lens& lens, const Eigen::Vector2d& from,
                            const Eigen::Vector2d& to, const EdgeFitSettings& settings);

}  // namespace silhouette
