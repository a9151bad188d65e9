// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/mask_shift.h"

#include <algorithm>
#include <opencv2/core.hpp>

#include "common/picture/picture.h"

namespace silhouette {
namespace {

constexpr int kMostShift = 5;  // whole pixels

// `image` with room around it.
cv::Mat Framed(const Mask& mask) {
  cv::Mat framed;
  cv::copyMakeBorder(MaskImage(mask), framed, kMostShift, kMostShift, kMostShift, kMostShift,
                     cv::BORDER_CONSTANT);
  return framed;
}

// `b`, framed, shifted.
cv::Mat Shifted(const cv::Mat& b, int x, int y, cv::Size size) {
  return b(cv::Rect({kMostShift - x, kMostShift - y}, size));
}

// What is left of the shift: where a rim of b goes to the right, so do pixels of a.
Eigen::Vector2d AtRims(const cv::Mat& a, const cv::Mat& b) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  const auto at = [&](int x, int y) { return b.at<uint8_t>(y, x) > 0 ? 1.0 : 0.0; };
  for (int y = 1; y + 1 < b.rows; ++y) {
    for (int x = 1; x + 1 < b.cols; ++x) {
      const Eigen::Vector2d slope(0.5 * (at(x + 1, y) - at(x - 1, y)),
                                  0.5 * (at(x, y + 1) - at(x, y - 1)));
      if (slope.isZero()) continue;
      normal += slope * slope.transpose();
      sum += slope * (at(x, y) - (a.at<uint8_t>(y, x) > 0 ? 1.0 : 0.0));
    }
  }
  if (normal.determinant() < 1e-6) return Eigen::Vector2d::Zero();
  return (normal.inverse() * sum).cwiseMax(-1).cwiseMin(1);
}

}  // namespace

Eigen::Vector2d ShiftOf(const Mask& a, const Mask& b) {
  if (a.Empty() || b.Empty()) return Eigen::Vector2d::Zero();
  const cv::Mat image = MaskImage(a);
  const cv::Mat framed = Framed(b);
  int best = -1;
  cv::Point shift;
  cv::Mat differs;
  for (int y = -kMostShift; y <= kMostShift; ++y) {
    for (int x = -kMostShift; x <= kMostShift; ++x) {
      cv::bitwise_xor(image, Shifted(framed, x, y, image.size()), differs);
      const int count = cv::countNonZero(differs);
      // Of those alike the smallest.
      const bool less = best < 0 || count < best ||
                        (count == best && x * x + y * y < shift.x * shift.x + shift.y * shift.y);
      if (!less) continue;
      best = count;
      shift = {x, y};
    }
  }
  return Eigen::Vector2d(shift.x, shift.y) +
         AtRims(image, Shifted(framed, shift.x, shift.y, image.size()));
}

}  // namespace silhouette
