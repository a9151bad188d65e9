// SPDX-License-Identifier: Apache-2.0
#include "capture/session/robot_outline.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "capture/segmentation/brightness.h"
#include "common/picture/picture.h"

namespace silhouette {
namespace {

// In pixels of the robot's mask: by how much an edge may be beside the outline, ...
constexpr int kNearOutline = 2;
// ... and how far beside there is another part of the cell.
constexpr int kBesideOutline = 12;
constexpr int kLeastOutline = 60;
constexpr double kSteepest = 0.2;  // share of the image that counts as edges

// 255 where the image is among the steepest, or a pixel near is.
cv::Mat Edges(const cv::Mat& image, cv::Size size) {
  cv::Mat grey;
  Grey(image).convertTo(grey, CV_32F);
  if (grey.size() != size) cv::resize(grey, grey, size, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(grey, grey, {}, 1);
  cv::Mat across;
  cv::Mat down;
  cv::Sobel(grey, across, CV_32F, 1, 0);
  cv::Sobel(grey, down, CV_32F, 0, 1);
  cv::Mat slope;
  cv::magnitude(across, down, slope);
  const int side = 2 * kNearOutline + 1;
  cv::dilate(slope, slope, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  std::vector<float> slopes(slope.begin<float>(), slope.end<float>());
  const auto limit =
      slopes.end() - static_cast<std::ptrdiff_t>(kSteepest * static_cast<double>(slopes.size()));
  std::nth_element(slopes.begin(), limit, slopes.end());
  return slope > *limit;
}

// Of the outline moved by so much, as far as it is in the image then.
double ShareOnEdges(const std::vector<cv::Point>& outline, const cv::Mat& edges, cv::Point by) {
  const cv::Rect image({}, edges.size());
  int within = 0;
  int on = 0;
  for (const cv::Point& point : outline) {
    const cv::Point at = point + by;
    if (!image.contains(at)) continue;
    ++within;
    on += edges.at<uint8_t>(at) != 0 ? 1 : 0;
  }
  return within == 0 ? 0 : static_cast<double>(on) / within;
}

}  // namespace

cv::Mat OutlineOf(const Mask& robot) {
  const cv::Mat mask = MaskImage(robot);
  cv::Mat inner;
  cv::erode(mask, inner, cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
  cv::Mat outline = mask - inner;
  cv::rectangle(outline, {0, 0, outline.cols, outline.rows}, cv::Scalar(0), 2 * kNearOutline + 1);
  return outline;
}

std::optional<RobotOutline> FindOutline(const cv::Mat& image, const Mask& robot) {
  std::vector<cv::Point> outline;
  cv::findNonZero(OutlineOf(robot), outline);
  if (outline.size() < kLeastOutline) return std::nullopt;
  const cv::Mat edges = Edges(image, {robot.width(), robot.height()});
  constexpr std::array<int, 3> kWays = {-kBesideOutline, 0, kBesideOutline};
  double beside = 0;
  for (const int x : kWays) {
    for (const int y : kWays) {
      if (x != 0 || y != 0) beside += ShareOnEdges(outline, edges, {x, y}) / 8;
    }
  }
  return RobotOutline{.there = ShareOnEdges(outline, edges, {}), .beside = beside};
}

}  // namespace silhouette
