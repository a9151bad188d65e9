// SPDX-License-Identifier: Apache-2.0
#include "capture/session/sentinel_sight.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "absl/strings/str_format.h"
#include "capture/segmentation/brightness.h"
#include "common/numbers/numbers.h"
#include "common/picture/picture.h"

namespace silhouette {
namespace {

constexpr double kMostGain = 1.2;
// Mask pixels away from the rim of the other mask that repeated images explain.
constexpr int kLeastCore = 4;
constexpr int kCoreShare = 50;

cv::Mat Grown(const cv::Mat& mask, int radius) {
  cv::Mat grown;
  const int side = 2 * radius + 1;
  cv::dilate(mask, grown, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  return grown;
}

std::string Direction(const ImageShift& shift) {
  const double x = std::abs(shift.x);
  const double y = std::abs(shift.y);
  const char* across = shift.x > 0 ? "to the right" : "to the left";
  const char* along = shift.y > 0 ? "down" : "up";
  if (y < 0.1) return absl::StrFormat("%.1f px %s", x, across);
  if (x < 0.1) return absl::StrFormat("%.1f px %s", y, along);
  return absl::StrFormat("%.1f px %s and %.1f px %s", x, across, y, along);
}

void CompareMasks(const Mask& first, const Mask& now, Sight& sight) {
  sight.mask_area = static_cast<int>(first.Count());
  sight.mask_pixels = static_cast<int>((first - now).Count() + (now - first).Count());
  sight.core_pixels =
      static_cast<int>((now - Grown(first, 1)).Count() + (first - Grown(now, 1)).Count());
}

}  // namespace

Sight Compare(const SentinelImage& first, const SentinelImage& now, const Reference& reference) {
  Sight sight;
  CompareMasks(first.mask, now.mask, sight);
  if (first.grey.empty()) return sight;
  const Reference grey = reference.AsGrey();
  sight.gain = BrightnessOf(now.grey, grey).gain / BrightnessOf(first.grey, grey).gain;
  cv::Mat robot;
  cv::resize(MaskImage(first.mask), robot, first.grey.size(), 0, 0, cv::INTER_NEAREST);
  robot = Grown(robot, 4);
  cv::Mat background = ~Grown(robot, 2);
  const bool sees_background =
      cv::countNonZero(background) * 10 > static_cast<int>(background.total());
  if (!sees_background) background.setTo(255);
  sight.background = LargestShift(first.grey, now.grey, background, sight.gain);
  sight.robot = ShiftBetween(first.grey, now.grey, robot, sight.gain);
  return sight;
}

std::string Complaint(const Sight& sight, double most_shift) {
  if (sight.background && sight.background->length() > most_shift) {
    return absl::StrFormat("moved by %.1f px (%s in its image): its camera is not where it was",
                           sight.background->length(), Direction(*sight.background));
  }
  if (sight.robot) {
    ImageShift shift = *sight.robot;
    if (sight.background) {
      shift.x -= sight.background->x;
      shift.y -= sight.background->y;
    }
    if (shift.length() > 2 * most_shift) {
      return absl::StrFormat(
          "shows the robot moved by %.1f px (%s in its image), and the background where it was: "
          "the robot is not where it says, or its tool changed",
          shift.length(), Direction(shift));
    }
  }
  if (sight.gain > kMostGain || sight.gain < 1 / kMostGain) {
    return absl::StrFormat("is %.2f times as bright as it was: the light changed", sight.gain);
  }
  if (sight.core_pixels > std::max(kLeastCore, sight.mask_area / kCoreShare)) {
    return absl::StrFormat(
        "has another mask by %d pixels, %d of them away from its rim, and did not move: the light "
        "changed, or something is in the cell that was not",
        sight.mask_pixels, sight.core_pixels);
  }
  return "";
}

namespace {

constexpr double kBlur = 1.2;           // pixels; takes noise away and makes slopes long enough
constexpr double kLeastContrast = 0.5;  // grey levels per pixel, root mean square
constexpr double kMostError = 0.25;     // pixels
constexpr int kFewestPixels = 400;
constexpr int kRounds = 12;
constexpr double kSettled = 0.002;  // pixels
// Blurred pixels are not independent of each other; this many are worth one.
constexpr double kPixelsPerSample = 4 * CV_PI * kBlur * kBlur;

cv::Mat Smooth(const cv::Mat& grey, double factor) {
  cv::Mat smooth;
  grey.convertTo(smooth, CV_32F, factor);
  cv::GaussianBlur(smooth, smooth, {}, kBlur, kBlur, cv::BORDER_REPLICATE);
  return smooth;
}

// What both images show, at a shift between them.
struct Fit {
  double x = 0;
  double y = 0;
  double cost = 0;   // mean square of what is left, what sticks out cut off
  double error = 0;  // of x and y
};

class Alignment {
 public:
  Alignment(const cv::Mat& first, const cv::Mat& now, const cv::Mat& region, double gain)
      : first_(Smooth(first, gain)), now_(Smooth(now, 1)), region_(region) {
    Slopes(first_, slope_x_, slope_y_);
  }

  bool Tells() const {
    cv::Mat square = slope_x_.mul(slope_x_) + slope_y_.mul(slope_y_);
    return cv::countNonZero(region_) >= kFewestPixels &&
           std::sqrt(cv::mean(square, region_)[0]) >= kLeastContrast;
  }

  // The whole pixels that phase correlation of the slopes says.
  cv::Point2d Guess() const {
    cv::Mat weight;
    region_.convertTo(weight, CV_32F, 1.0 / 255);
    cv::GaussianBlur(weight, weight, {}, 3);
    cv::Mat window;
    cv::createHanningWindow(window, first_.size(), CV_32F);
    return cv::phaseCorrelate(Edges(first_).mul(weight), Edges(now_).mul(weight), window);
  }

  // Least squares from a beginning; what lies beyond `most_left` grey levels has little weight.
  Fit From(cv::Point2d begin, double most_left) const {
    Fit fit{.x = begin.x, .y = begin.y};
    for (int round = 0; round < kRounds; ++round) {
      const Sums sums = SumAt(fit.x, fit.y, most_left);
      const double determinant = sums.xx * sums.yy - sums.xy * sums.xy;
      if (determinant <= 1e-9 * sums.xx * sums.yy || sums.count == 0) break;
      const double step_x = (sums.yy * sums.xd - sums.xy * sums.yd) / determinant;
      const double step_y = (sums.xx * sums.yd - sums.xy * sums.xd) / determinant;
      fit.cost = sums.cost / sums.count;
      fit.error = std::sqrt(fit.cost * std::max(sums.xx, sums.yy) / determinant *
                            std::min(kPixelsPerSample, sums.count));
      // Slopes say nothing of what is far away.
      fit.x += std::clamp(step_x, -2.0, 2.0);
      fit.y += std::clamp(step_y, -2.0, 2.0);
      if (std::abs(step_x) < kSettled && std::abs(step_y) < kSettled) break;
    }
    return fit;
  }

  double CostAt(double x, double y, double most_left) const {
    const Sums sums = SumAt(x, y, most_left);
    return sums.count > 0 ? sums.cost / sums.count : INFINITY;
  }

  // Grey levels that most pixels are off by at a shift.
  double TypicalDifference(cv::Point2d shift) const {
    std::vector<double> differences;
    const cv::Mat there = Moved(shift.x, shift.y);
    for (int y = 0; y < first_.rows; y += 2) {
      for (int x = 0; x < first_.cols; x += 2) {
        if (region_.at<uint8_t>(y, x) == 0) continue;
        differences.push_back(std::abs(there.at<float>(y, x) - first_.at<float>(y, x)));
      }
    }
    return std::max(1.0, 4.5 * Median(std::move(differences)));
  }

 private:
  struct Sums {
    double xx = 0;
    double xy = 0;
    double yy = 0;
    double xd = 0;
    double yd = 0;
    double cost = 0;
    double count = 0;
  };

  static void Slopes(const cv::Mat& smooth, cv::Mat& x, cv::Mat& y) {
    cv::Sobel(smooth, x, CV_32F, 1, 0, 3, 1.0 / 8);
    cv::Sobel(smooth, y, CV_32F, 0, 1, 3, 1.0 / 8);
  }

  static cv::Mat Edges(const cv::Mat& smooth) {
    cv::Mat x;
    cv::Mat y;
    cv::Mat edges;
    Slopes(smooth, x, y);
    cv::magnitude(x, y, edges);
    return edges;
  }

  // `now` as it would look if it had not moved so.
  cv::Mat Moved(double x, double y) const {
    const cv::Matx23d by(1, 0, x, 0, 1, y);
    cv::Mat moved;
    cv::warpAffine(now_, moved, by, now_.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                   cv::BORDER_CONSTANT, cv::Scalar(NAN));
    return moved;
  }

  Sums SumAt(double x, double y, double most_left) const {
    const cv::Mat there = Moved(x, y);
    Sums sums;
    for (int row = 0; row < first_.rows; ++row) {
      const auto* counts = region_.ptr<uint8_t>(row);
      const auto* before = first_.ptr<float>(row);
      const auto* after = there.ptr<float>(row);
      const auto* slope_x = slope_x_.ptr<float>(row);
      const auto* slope_y = slope_y_.ptr<float>(row);
      for (int column = 0; column < first_.cols; ++column) {
        if (counts[column] == 0 || std::isnan(after[column])) continue;
        const double left = after[column] - before[column];
        // At x + shift, `now` shows what `first` has at x: what is left falls along the slope.
        const double weight = std::min(1.0, most_left / std::max(std::abs(left), 1e-6));
        const double gx = slope_x[column];
        const double gy = slope_y[column];
        sums.xx += weight * gx * gx;
        sums.xy += weight * gx * gy;
        sums.yy += weight * gy * gy;
        sums.xd -= weight * gx * left;
        sums.yd -= weight * gy * left;
        sums.cost += weight * left * left;
        sums.count += 1;
      }
    }
    return sums;
  }

  const cv::Mat first_;
  const cv::Mat now_;
  const cv::Mat region_;
  cv::Mat slope_x_;
  cv::Mat slope_y_;
};

}  // namespace

double ImageShift::length() const { return std::hypot(x, y); }

std::optional<ImageShift> ShiftBetween(const cv::Mat& first, const cv::Mat& now,
                                       const cv::Mat& region, double gain) {
  const Alignment alignment(first, now, region, gain);
  if (!alignment.Tells()) return std::nullopt;
  const cv::Point2d guess = alignment.Guess();
  const double most_left =
      std::min(alignment.TypicalDifference({0, 0}), alignment.TypicalDifference(guess));
  const Fit near = alignment.From({0, 0}, most_left);
  const Fit far = alignment.From(guess, most_left);
  const Fit& best = far.cost < near.cost ? far : near;
  const double at_rest = alignment.CostAt(0, 0, most_left);
  if (best.error > kMostError || !std::isfinite(best.error)) return std::nullopt;
  if (best.cost > at_rest) return ImageShift{.error = best.error};
  // Large shifts must explain much: what is new in the cell looks like one here and there.
  if (std::hypot(best.x, best.y) > 0.5 && best.cost > 0.8 * at_rest) return std::nullopt;
  return ImageShift{.x = best.x, .y = best.y, .error = best.error};
}

std::optional<ImageShift> LargestShift(const cv::Mat& first, const cv::Mat& now,
                                       const cv::Mat& region, double gain) {
  std::optional<ImageShift> largest = ShiftBetween(first, now, region, gain);
  const cv::Size half(first.cols / 2, first.rows / 2);
  for (const cv::Point corner : {cv::Point(0, 0), cv::Point(half.width, 0),
                                 cv::Point(0, half.height), cv::Point(half.width, half.height)}) {
    const cv::Rect part(corner, half);
    const auto shift = ShiftBetween(first(part), now(part), region(part), gain);
    if (!shift) continue;
    // What turns or is seen aslant does not move alike everywhere.
    if (!largest || shift->length() > 1.5 * largest->length() + 3 * shift->error) largest = shift;
  }
  return largest;
}

}  // namespace silhouette
