// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/weak_calibration.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace silhouette {
namespace {

constexpr size_t kLeastCorners = 16;
constexpr double kSamePlace = 1;      // pixels
constexpr double kLeastShare = 0.04;  // of an image
// How well a plane may fit: standard deviations of the corners, or pixels, for lenses that bow it.
constexpr double kPlaneDeviations = 3;
constexpr double kPlanePixels = 2;

std::vector<cv::Point2d> PointsOf(std::span<const Correspondence> corners,
                                  Eigen::Vector2d Correspondence::*point) {
  std::vector<cv::Point2d> points;
  for (const Correspondence& corner : corners) {
    points.emplace_back((corner.*point).x(), (corner.*point).y());
  }
  return points;
}

std::string Percent(double share) {
  return std::to_string(static_cast<int>(std::lround(100 * share))) + " %";
}

// Whether all points lie at nearly one place in both images, frame by frame.
bool Stood(const std::vector<const Correspondence*>& one,
           const std::vector<const Correspondence*>& other) {
  if (one.size() != other.size()) return false;
  for (size_t i = 0; i < one.size(); ++i) {
    if ((one[i]->a - other[i]->a).norm() > kSamePlace) return false;
    if ((one[i]->b - other[i]->b).norm() > kSamePlace) return false;
  }
  return true;
}

std::string OutOfPlane(const ViewPair& pair) {
  const std::vector<int> first = FirstAtSamePlace(pair);
  int places = 0;
  for (size_t i = 0; i < first.size(); ++i) places += first[i] == static_cast<int>(i) ? 1 : 0;
  const std::string mend =
      "; a plane looks the same for many pairs of cameras. Move and tilt the board between frames, "
      "so that the tags fill the space that both views see";
  if (pair.frames.size() == 1)
    return "there is one frame, and all its tags lie on one plane" + mend;
  if (places == 1) {
    return "the tags stand at the same place in all " + std::to_string(pair.frames.size()) +
           " frames, all on one plane" + mend;
  }
  return "all tags of all frames lie on one plane" + mend;
}

}  // namespace

std::vector<int> FirstAtSamePlace(const ViewPair& pair) {
  std::vector<std::vector<const Correspondence*>> by_frame(pair.frames.size());
  for (const Correspondence& corner : pair.corners) {
    by_frame[static_cast<size_t>(corner.frame)].push_back(&corner);
  }
  std::vector<int> first;
  for (size_t i = 0; i < by_frame.size(); ++i) {
    size_t same = 0;
    while (same < i && !Stood(by_frame[same], by_frame[i])) ++same;
    first.push_back(static_cast<int>(same));
  }
  return first;
}

bool OnOnePlane(std::span<const Correspondence> corners) {
  if (corners.size() < 5) return true;
  const std::vector<cv::Point2d> a = PointsOf(corners, &Correspondence::a);
  const std::vector<cv::Point2d> b = PointsOf(corners, &Correspondence::b);
  const cv::Mat homography = cv::findHomography(a, b);
  if (homography.empty()) return true;
  std::vector<cv::Point2d> there;
  cv::perspectiveTransform(a, there, homography);
  double squares = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const double sigma = std::hypot(corners[i].sigma_a, corners[i].sigma_b);
    const double limit = std::max(kPlanePixels, kPlaneDeviations * sigma);
    squares += std::pow(cv::norm(there[i] - b[i]) / limit, 2) / 2;
  }
  return squares < static_cast<double>(corners.size());
}

double ShareOfImage(std::span<const Correspondence> corners, Eigen::Vector2d Correspondence::*point,
                    PixelSize image) {
  std::vector<cv::Point2f> points;
  for (const cv::Point2d& p : PointsOf(corners, point)) points.emplace_back(p);
  std::vector<cv::Point2f> hull;
  cv::convexHull(points, hull);
  return hull.size() < 3 ? 0 : cv::contourArea(hull) / image.width / image.height;
}

std::optional<std::string> WhyDegenerate(const ViewPair& pair, PixelSize image_a,
                                         PixelSize image_b) {
  if (pair.corners.size() < kLeastCorners) {
    return "both views saw only " + std::to_string(pair.corners.size()) +
           " corners of tags at once, where at least " + std::to_string(kLeastCorners) +
           " are needed; take more frames in which both see a board";
  }
  if (OnOnePlane(pair.corners)) return OutOfPlane(pair);
  const double share_a = ShareOfImage(pair.corners, &Correspondence::a, image_a);
  const double share_b = ShareOfImage(pair.corners, &Correspondence::b, image_b);
  if (std::min(share_a, share_b) < kLeastShare) {
    return "all corners lie in one place of the image of '" +
           (share_a < share_b ? pair.view_a : pair.view_b) + "', within " +
           Percent(std::min(share_a, share_b)) +
           " of it; a matrix holds only where tags were: show boards all over what both views see";
  }
  return std::nullopt;
}

}  // namespace silhouette
