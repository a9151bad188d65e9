// SPDX-License-Identifier: Apache-2.0
#include "capture/session/silhouette_drift.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
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
// Turns, in mask pixels by which they move the corner of the image that they move most.
constexpr double kTurnStep = 0.25;
constexpr double kTurnTold = 1.5;
// Mask pixels that noise may change, at least and of the outline.
constexpr double kLeastNoise = 4;
constexpr double kNoise = 0.03;

using Eigen::Matrix2d;
using Eigen::Vector2d;

Matrix2d Rotation(double turn) { return Eigen::Rotation2Dd(turn).toRotationMatrix(); }

// Pixels of the camera image.
Vector2d MiddleOf(const Mask& robot, const ViewSizes& sizes) {
  Vector2d sum = Vector2d::Zero();
  for (int y = 0; y < robot.height(); ++y) {
    for (int x = 0; x < robot.width(); ++x) {
      if (robot.at(x, y)) sum += Vector2d(x + 0.5, y + 0.5);
    }
  }
  const Vector2d to_image(static_cast<double>(sizes.image.width) / robot.width(),
                          static_cast<double>(sizes.image.height) / robot.height());
  return (sum / static_cast<double>(robot.Count())).cwiseProduct(to_image) -
         Vector2d::Constant(0.5);
}

// How unlike the mask of a moved foreground is to the robot image, near the robot.
class OutlineComparison {
 public:
  // Turns are about `middle`.
  OutlineComparison(cv::Mat foreground, const Mask& robot, const Vector2d& middle, double min_cover)
      : foreground_(std::move(foreground)),
        robot_(robot),
        middle_(middle),
        near_(robot),
        min_cover_(min_cover) {
    for (int i = 0; i < kDriftReach; ++i) near_ = Grown(near_, 1);
  }

  // The same, with a foreground that is turned back.
  OutlineComparison Turned(double turn) const {
    const Matrix2d rotation = Rotation(turn);
    const Vector2d offset = middle_ - rotation * middle_;
    const cv::Matx23d back(rotation(0, 0), rotation(0, 1), offset.x(),  //
                           rotation(1, 0), rotation(1, 1), offset.y());
    cv::Mat turned;
    cv::warpAffine(foreground_, turned, back, foreground_.size(),
                   cv::INTER_NEAREST | cv::WARP_INVERSE_MAP);
    OutlineComparison comparison = *this;
    comparison.foreground_ = turned;
    return comparison;
  }

  // Mask pixels of the robot's rim.
  int outline() const { return static_cast<int>(robot_.Count() - Core(robot_).Count()); }
  // Mask pixels that noise may change.
  double noise() const { return std::max(kLeastNoise, kNoise * outline()); }

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
  cv::Mat foreground_;
  Mask robot_;
  Vector2d middle_;
  Mask near_;  // the robot and up to kDriftReach pixels around it
  double min_cover_;
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
Vector2d MiddleShift(const OutlineComparison& comparison, const BestShift& best, cv::Size reach) {
  Vector2d sum = Vector2d::Zero();
  double weights = 0;
  for (int y = best.y - reach.height; y <= best.y + reach.height; ++y) {
    for (int x = best.x - reach.width; x <= best.x + reach.width; ++x) {
      const int more = comparison.Unlike(x, y) - best.unlike;
      const double weight = more <= 2 ? 1.0 / (1 + more * more) : 0;
      sum += weight * Vector2d(x, y);
      weights += weight;
    }
  }
  return sum / weights;
}

// A motion of the image: a turn about the robot's middle (radians, clockwise), then a shift.
struct BestMotion {
  double turn = 0;
  BestShift shift;  // of the foreground that is turned back
};

cv::Size Half(cv::Size size) { return {std::max(1, size.width / 2), std::max(1, size.height / 2)}; }

// The best motion with a turn and a shift near `still`, which is the best without a turn. Without
// one if no turn makes more of a difference than noise. `radian`: how far a turn by a radian moves
// the corner of the image that it moves most, in mask pixels.
BestMotion SearchTurn(const OutlineComparison& comparison, const BestShift& still, double radian,
                      cv::Size reach) {
  const cv::Size step = Half(reach);
  BestMotion best{0, {0, 0, std::numeric_limits<int>::max()}};
  constexpr int kSteps = static_cast<int>(kDriftReach / kTurnStep);
  for (int i = -kSteps; i <= kSteps; ++i) {
    const double turn = i * kTurnStep / radian;
    const BestShift shift = SearchShift(comparison.Turned(turn), still, reach, step);
    if (shift.unlike < best.shift.unlike) best = {turn, shift};
  }
  best.shift = SearchShift(comparison.Turned(best.turn), best.shift, step, {1, 1});
  return still.unlike - best.shift.unlike < comparison.noise() ? BestMotion{0, still} : best;
}

// Whether every shift by 1.5 mask pixels makes the outline more unlike.
bool TellsShift(const OutlineComparison& turned, const BestShift& best, cv::Size half) {
  for (const auto& [x, y] :
       {std::pair{3, 0}, {-3, 0}, {0, 3}, {0, -3}, {2, 2}, {-2, -2}, {2, -2}, {-2, 2}}) {
    const int there = turned.Unlike(best.x + x * half.width, best.y + y * half.height);
    if (there - best.unlike < kSteep * turned.outline()) return false;
  }
  return true;
}

// Whether turns by kTurnTold either way do, by more than noise and with whatever shift.
bool TellsTurn(const OutlineComparison& comparison, const BestMotion& best, double radian,
               cv::Size half) {
  const cv::Size step = Half(half);
  for (const double turn : {-kTurnTold / radian, kTurnTold / radian}) {
    const OutlineComparison turned = comparison.Turned(best.turn + turn);
    const BestShift rough = SearchShift(turned, best.shift, half, step);
    const BestShift there = SearchShift(turned, rough, step, {1, 1});
    if (there.unlike - best.shift.unlike < comparison.noise()) return false;
  }
  return true;
}

std::vector<Vector2d> CornersOf(PixelSize image) {
  const Vector2d size(image.width, image.height);
  std::vector<Vector2d> corners;
  for (const double x : {0.0, 1.0}) {
    for (const double y : {0.0, 1.0}) {
      corners.push_back(size.cwiseProduct(Vector2d(x, y)) - Vector2d::Constant(0.5));
    }
  }
  return corners;
}

Vector2d ToMask(const ViewSizes& sizes) {
  return {static_cast<double>(sizes.mask.width) / sizes.image.width,
          static_cast<double>(sizes.mask.height) / sizes.image.height};
}

// Mask pixels by which a turn by a radian moves the corner of the image that it moves most.
double MotionOfRadian(const ViewSizes& sizes, const Vector2d& middle) {
  double most = 0;
  for (const Vector2d& corner : CornersOf(sizes.image)) {
    const Vector2d arm = corner - middle;
    most = std::max(most, Vector2d(arm.y(), arm.x()).cwiseProduct(ToMask(sizes)).norm());
  }
  return most;
}

// Fills in how far the image moved: by `turn` about `middle`, then by `shift`.
void SetMotion(const ViewSizes& sizes, const Vector2d& middle, double turn, const Vector2d& shift,
               ViewDrift& drift) {
  const Matrix2d turning = Rotation(turn) - Matrix2d::Identity();
  const auto at = [&](const Vector2d& pixel) -> Vector2d {
    return shift + turning * (pixel - middle);
  };
  drift.turn = turn;
  drift.shift = at({0.5 * (sizes.image.width - 1), 0.5 * (sizes.image.height - 1)});
  for (const Vector2d& corner : CornersOf(sizes.image)) {
    drift.moved = std::max(drift.moved, at(corner).norm());
    drift.moved_mask = std::max(drift.moved_mask, at(corner).cwiseProduct(ToMask(sizes)).norm());
  }
  drift.checked = true;
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
  const Vector2d middle = MiddleOf(robot, sizes);
  const OutlineComparison comparison(Foreground(image, reference, settings), robot, middle,
                                     settings.min_cover);
  // Pixels of the camera image per mask pixel.
  const cv::Size pitch(std::max(1, sizes.image.width / sizes.mask.width),
                       std::max(1, sizes.image.height / sizes.mask.height));
  const cv::Size half = Half(pitch);
  const double radian = MotionOfRadian(sizes, middle);
  const BestShift rough = SearchShift(comparison, {}, pitch * kDriftReach, half);
  const BestShift still = SearchShift(comparison, rough, half, {1, 1});
  const BestMotion best = SearchTurn(comparison, still, radian, half);
  const OutlineComparison turned = comparison.Turned(best.turn);
  if (best.shift.unlike > kAlike * comparison.outline()) {
    drift.message =
        "its image does not show the robot as it was captured, however it is shifted; is the robot "
        "where it is said to be, is anything else in the cell, or did the camera move a long way?";
  } else if (!TellsShift(turned, best.shift, half)) {
    drift.message =
        "the robot's outline leaves open how far the camera moved along it; park the robot so that "
        "all of its arm is seen";
  } else if (!TellsTurn(comparison, best, radian, half)) {
    drift.message =
        "the robot's outline is too compact to show whether the camera turned; use tags, or park "
        "the robot so that its arm is stretched out";
  } else {
    const Vector2d shift = Rotation(best.turn) * MiddleShift(turned, best.shift, half);
    SetMotion(sizes, middle, best.turn, shift, drift);
  }
  return drift;
}

}  // namespace silhouette
