#include "tools/silhouette-calibrate/drift_pictures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"

namespace silhouette {
namespace {

constexpr int kSide = 760;           // about, in pixels
constexpr double kLongest = 60;      // of an arrow
constexpr double kMostLonger = 500;  // arrows are lengthened by no more

cv::Scalar DriftPicturesBgr(Colour colour) {
  return {double(colour.blue), double(colour.green), double(colour.red)};
}

}  // namespace

Picture PaintDrift(const ViewDrift& drift, const ViewSizes& sizes, double limit_mask) {
  const double scale = static_cast<double>(kSide) / std::max(sizes.image.width, sizes.image.height);
  Picture picture =
      BlankPicture(static_cast<int>(std::lround(sizes.image.width * scale)),
                   static_cast<int>(std::lround(sizes.image.height * scale)), palette::kBackground);
  double longest = 0;
  for (size_t i = 0; i < drift.before.size(); ++i) {
    longest = std::max(longest, (drift.after[i] - drift.before[i]).norm());
  }
  const double longer =
      longest > 0 ? std::min(kMostLonger, std::floor(kLongest / (scale * longest)) + 1) : 1;
  const bool moved = drift.moved_mask > limit_mask;
  const auto at = [&](const Eigen::Vector2d& pixel) {
    return cv::Point(static_cast<int>(std::lround((pixel.x() + 0.5) * scale)),
                     static_cast<int>(std::lround((pixel.y() + 0.5) * scale)));
  };
  for (size_t i = 0; i < drift.before.size(); ++i) {
    const Eigen::Vector2d& from = drift.before[i];
    const cv::Point begin = at(from);
    cv::arrowedLine(picture, begin, at(from + longer * (drift.after[i] - from)),
                    DriftPicturesBgr(moved ? palette::kObstacle : palette::kRobot), 2, cv::LINE_AA,
                    0, 0.2);
    cv::circle(picture, begin, 2, DriftPicturesBgr(palette::kInk), cv::FILLED, cv::LINE_AA);
  }
  std::string caption = "not checked";
  if (drift.checked && drift.corners == 0) {
    caption = absl::StrFormat("by the robot's silhouette: shift (%.2f, %.2f) px", drift.shift.x(),
                              drift.shift.y());
  } else if (drift.checked) {
    caption = absl::StrFormat("%d corners; arrows %.0f times as long as the motion", drift.corners,
                              longer);
  }
  return ContactSheet(
      {{picture, caption}},
      {.title = absl::StrFormat("%s: moved by %.2f px, %.3f mask px of %.3g allowed", drift.view,
                                drift.moved, drift.moved_mask, limit_mask),
       .columns = 1,
       .legend = {}});
}

}  // namespace silhouette
