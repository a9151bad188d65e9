// SPDX-License-Identifier: Apache-2.0
// The corners of a tag as the places where its fitted edges meet.
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/camera/camera_model.h"

namespace silhouette {

// Pixels as they are, and where they were if the camera had no distortion, so that straight edges
// are straight. Of a camera that is not known they stay where they are. Nothing where it sees no
// ray.
std::optional<Eigen::Vector2d> Undistorted(const std::optional<CameraModel>& lens,
                                           const Eigen::Vector2d& pixel);
std::optional<Eigen::Vector2d> Distorted(const std::optional<CameraModel>& lens,
                                         const Eigen::Vector2d& undistorted);
// How an undistorted position follows the pixel; the identity where that cannot be said.
Eigen::Matrix2d UndistortedPerPixel(const std::optional<CameraModel>& lens,
                                    const Eigen::Vector2d& pixel);

// How a line of corners bends an edge between them: the quadratic and the cubic term of its offset.
struct Bend {
  double quadratic = 0;
  double cubic = 0;
};

// Where a straight edge between dark and bright lies in an image, to some hundredths of a pixel:
// a blurred step is fitted to the grey values of all pixels beside it.
// An edge in undistorted pixels: at `along`, from -1 to 1 on the way from one end to the other, it
// is `offset(along)` pixels to the side of the straight line through both ends.
class Edge {
 public:
  Edge(const Eigen::Vector2d& from, const Eigen::Vector2d& to);

  double Along(const Eigen::Vector2d& at) const { return tangent_.dot(at - middle_) / half_; }
  double Offset(double along) const {
    return shape_[0] + along * (shape_[1] + along * (shape_[2] + along * cubic_));
  }
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
  Eigen::Vector2d normal() const { return {-tangent_.y(), tangent_.x()}; }
  double blur() const { return blur_; }  // standard deviation of its blur, with a pixel's own width
  double contrast() const { return contrast_; }  // grey levels from one side to the other
  double noise() const { return noise_; }        // of a grey value about the fit
  // From 0, none, to 1: how much of its bright side is as white as the image can show.
  double saturation() const { return saturation_; }

 private:
  friend class EdgeFitter;

  Eigen::Vector2d middle_;
  Eigen::Vector2d tangent_;
  double half_;
  Eigen::Vector3d shape_ = Eigen::Vector3d::Zero();       // of Offset: constant, linear, quadratic
  double cubic_ = 0;                                      // its cubic term
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();  // of the shape
  double blur_ = 0;
  double contrast_ = 0;
  double noise_ = 0;
  double saturation_ = 0;
};

struct EdgeFitSettings {
  double reach = 4;     // pixels to either side that are looked at
  double end_gap = 3;   // pixels left out at both ends, where the next edge begins
  bool curved = false;  // the edge may be a parabola
  Bend bend = {};       // otherwise it is bent so
};

// The edge near the straight line between two undistorted positions. `image`: CV_8UC1. Nothing if
// there is none: too few pixels in the image, no contrast, or the fit does not settle.
std::optional<Edge> FitEdge(const cv::Mat& image, const std::optional<CameraModel>& lens,
                            const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                            const EdgeFitSettings& settings);

using PixelCorners = std::array<Eigen::Vector2d, 4>;

struct FittedCorners {
  PixelCorners corners{};
  double sigma = 0;  // standard deviation per axis, pixels
  double blur = 0;   // mean of the edges', pixels
  double contrast = 0;
};

// `corners`: roughly, pixels with integers at pixel centres, of one tag and in an order that goes
// around it. `border`: how wide the tag is of one colour on either side of its edges, pixels. With
// an unknown lens edges may be curved. Nothing if an edge is not there as it should be, or a corner
// is not near where it was.
std::optional<FittedCorners> FitCorners(const cv::Mat& image,
                                        const std::optional<CameraModel>& lens,
                                        const PixelCorners& corners, double border);

struct FittedCorner {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  // pixels
  double sigma = 0;                              // standard deviation per axis, pixels
  double blur = 0;                               // mean of the edges', pixels
};

// A chessboard's inner corners, row by row, as far as they are known.
struct ChessCorners {
  int rows = 0;
  int columns = 0;
  std::vector<std::optional<Eigen::Vector2d>> at;  // pixels with integers at pixel centres
};

// Each corner as the place where the edges meet that lie between it and its neighbours, or between
// it and the board's rim. `room`: the share of a square's side beside an edge in which there is no
// other edge. Nothing where fewer than one edge in each direction is there as it should be, or
// squares are too small for their blur.
std::vector<std::optional<FittedCorner>> FitChessCorners(const cv::Mat& image,
                                                         const std::optional<CameraModel>& lens,
                                                         const ChessCorners& corners, double room);

}  // namespace silhouette
