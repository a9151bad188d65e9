// SPDX-License-Identifier: Apache-2.0
#include "capture/session/silhouette_drift.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "capture/segmentation/difference.h"
#include "capture/segmentation/down_sampling.h"
#include "common/picture/picture.h"

namespace silhouette {
namespace {

constexpr int kDriftReach = 4;      // mask pixels each way
constexpr size_t kLeastRobot = 30;  // least mask pixels of a useful silhouette
constexpr double kAlike = 0.35;     // most that may differ, of the outline
constexpr double kSteep = 0.07;     // least that a shift by 1.5 mask pixels changes, of the outline

// How unlike the mask of a shifted foreground is to the robot image, near the robot.
class OutlineComparison {
 public:
  OutlineComparison(cv::Mat foreground, const Mask& robot, double min_cover)
      : foreground_(std::move(foreground)), robot_(robot), near_(robot), min_cover_(min_cover) {
    for (int i = 0; i < kDriftReach; ++i) near_ = Grown(near_, 1);
  }

  // Mask pixels of the robot's rim.
  int outline() const { return static_cast<int>(robot_.Count() - Core(robot_).Count()); }

  // For a foreground that is moved back by (dx, dy) pixels of the camera image.
  int Unlike(int dx, int dy) const {
    cv::Mat moved = cv::Mat::zeros(foreground_.size(), CV_8U);
    const cv::Rect all({0, 0}, foreground_.size());
    const cv::Rect to = cv::Rect(cv::Point(-dx, -dy), foreground_.size()) & all;
    if (!to.empty()) foreground_(to + cv::Point(dx, dy)).copyTo(moved(to));
    const Mask mask = DownSample(moved, robot_.size(), min_cover_);
    return static_cast<int>((((mask - robot_) | (robot_ - mask)) & near_).Count());
  }

 private:
  const cv::Mat foreground_;
  const Mask robot_;
  Mask near_;  // the robot and up to kDriftReach pixels around it
  const double min_cover_;
};

struct BestShift {
  int x = 0;
  int y = 0;
  int unlike = 0;
};

BestShift SearchShift(const OutlineComparison& comparison, BestShift around, cv::Size reach,
                      cv::Size step) {
  BestShift best{around.x, around.y, comparison.Unlike(around.x, around.y)};
  for (int y = around.y - reach.height; y <= around.y + reach.height; y += step.height) {
    for (int x = around.x - reach.width; x <= around.x + reach.width; x += step.width) {
      const int unlike = comparison.Unlike(x, y);
      if (unlike < best.unlike) best = {x, y, unlike};
    }
  }
  return best;
}

// The middle of the shifts around the best that are as good: the outline moves in whole mask pixels
// only here and there, so that several are.
Eigen::Vector2d MiddleShift(const OutlineComparison& comparison, const BestShift& best,
                            cv::Size reach) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weights = 0;
  for (int y = best.y - reach.height; y <= best.y + reach.height; ++y) {
    for (int x = best.x - reach.width; x <= best.x + reach.width; ++x) {
      const int more = comparison.Unlike(x, y) - best.unlike;
      const double weight = more <= 2 ? 1.0 / (1 + more * more) : 0;
      sum += weight * Eigen::Vector2d(x, y);
      weights += weight;
    }
  }
  return sum / weights;
}

}  // namespace

ViewDrift DriftBySilhouette(const std::string& view, const ViewSizes& sizes, const cv::Mat& image,
                            const Reference& reference, const SegmentationSettings& settings,
                            const Mask& robot) {
  ViewDrift drift;
  drift.view = view;
  drift.method = "silhouettes";
  if (robot.Count() < kLeastRobot) {
    drift.message = "the robot is hardly seen there; park it where every camera sees it";
    return drift;
  }
  const OutlineComparison comparison(Foreground(image, reference, settings), robot,
                                     settings.min_cover);
  // Pixels of the camera image per mask pixel.
  const cv::Size pitch(std::max(1, sizes.image.width / sizes.mask.width),
                       std::max(1, sizes.image.height / sizes.mask.height));
  const cv::Size half(std::max(1, pitch.width / 2), std::max(1, pitch.height / 2));
  const BestShift rough = SearchShift(comparison, {}, pitch * kDriftReach, half);
  const BestShift best = SearchShift(comparison, rough, half, {1, 1});
  if (best.unlike > kAlike * comparison.outline()) {
    drift.message =
        "its image does not show the robot as it was captured, however it is shifted; is the robot "
        "where it is said to be, is anything else in the cell, or did the camera move a long way?";
    return drift;
  }
  for (const auto& [x, y] :
       {std::pair{3, 0}, {-3, 0}, {0, 3}, {0, -3}, {2, 2}, {-2, -2}, {2, -2}, {-2, 2}}) {
    const int there = comparison.Unlike(best.x + x * half.width, best.y + y * half.height);
    if (there - best.unlike >= kSteep * comparison.outline()) continue;
    drift.message =
        "the robot's outline leaves open how far the camera moved along it; park the robot so that "
        "all of its arm is seen";
    return drift;
  }
  drift.shift = MiddleShift(comparison, best, half);
  drift.moved = drift.shift.norm();
  drift.moved_mask = drift.shift
                         .cwiseProduct(Eigen::Vector2d(
                             static_cast<double>(sizes.mask.width) / sizes.image.width,
                             static_cast<double>(sizes.mask.height) / sizes.image.height))
                         .norm();
  drift.checked = true;
  return drift;
}

}  // namespace silhouette
