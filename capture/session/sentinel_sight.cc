#include "capture/session/sentinel_sight.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_format.h"
#include "capture/segmentation/brightness.h"

namespace silhouette {
namespace {

constexpr double kMostGain = 1.2;
// Mask pixels away from the rim of the other mask that repeated images explain.
constexpr int kLeastCore = 4;
constexpr int kCoreShare = 50;

cv::Mat MatOf(const Mask& mask) {
  cv::Mat mat(mask.height(), mask.width(), CV_8UC1);
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      mat.at<uint8_t>(y, x) = mask.at(x, y) ? 255 : 0;
    }
  }
  return mat;
}

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

void CompareMasks(const cv::Mat& first, const cv::Mat& now, Sight& sight) {
  sight.mask_area = cv::countNonZero(first);
  sight.mask_pixels = cv::countNonZero(first != now);
  sight.core_pixels =
      cv::countNonZero(now & ~Grown(first, 1)) + cv::countNonZero(first & ~Grown(now, 1));
}

}  // namespace

Sight Compare(const SentinelImage& first, const SentinelImage& now, const Reference& reference) {
  Sight sight;
  const cv::Mat mask = MatOf(first.mask);
  CompareMasks(mask, MatOf(now.mask), sight);
  if (first.grey.empty()) return sight;
  const Reference grey = reference.AsGrey();
  sight.gain = BrightnessOf(now.grey, grey).gain / BrightnessOf(first.grey, grey).gain;
  cv::Mat robot;
  cv::resize(mask, robot, first.grey.size(), 0, 0, cv::INTER_NEAREST);
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

}  // namespace silhouette
