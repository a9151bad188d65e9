// SPDX-License-Identifier: Apache-2.0
#include "common/picture/text.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace silhouette {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr int kOversampling = 4;      // drawn larger and scaled down: smoother than drawn small
constexpr double kCapHeight = 22.0;   // of the font at scale 1
constexpr double kCapPerLine = 0.62;  // capitals take this share of a line's height

double ScaleOf(int height) { return height * kCapPerLine / kCapHeight; }

int ThicknessOf(int height) { return std::max(1, height * kOversampling / 13); }

// The ink of a text, 0 to 255, tightly around it but for full line height.
cv::Mat Ink(const std::string& text, int height) {
  const int line = height * kOversampling;
  const double scale = ScaleOf(line);
  const int thickness = ThicknessOf(height);
  int below = 0;
  const cv::Size size = cv::getTextSize(text, kFont, scale, thickness, &below);
  const int width = (size.width / kOversampling + 2) * kOversampling;
  cv::Mat large(line, width, CV_8UC1, cv::Scalar(0));
  const int baseline = static_cast<int>(std::lround(line * (0.46 + kCapPerLine / 2)));
  cv::putText(large, text, {kOversampling, baseline}, kFont, scale, cv::Scalar(255), thickness,
              cv::LINE_AA);
  cv::Mat ink;
  cv::resize(large, ink, {}, 1.0 / kOversampling, 1.0 / kOversampling, cv::INTER_AREA);
  return ink;
}

}  // namespace

int TextWidth(const std::string& text, int height) {
  int below = 0;
  return cv::getTextSize(text, kFont, ScaleOf(height * kOversampling), ThicknessOf(height), &below)
                 .width /
             kOversampling +
         2;
}

std::string Shortened(const std::string& text, int width, int height) {
  if (TextWidth(text, height) <= width) return text;
  std::string kept = text;
  while (!kept.empty() && TextWidth(kept + "...", height) > width) kept.pop_back();
  return kept + "...";
}

void DrawText(Picture& picture, const std::string& text, cv::Point anchor, const TextStyle& style) {
  if (text.empty()) return;
  cv::Mat ink = Ink(text, style.height);
  const int length = ink.cols;
  if (style.upwards) cv::rotate(ink, ink, cv::ROTATE_90_COUNTERCLOCKWISE);
  int before = 0;
  if (style.across == Align::kMiddle) before = length / 2;
  if (style.across == Align::kEnd) before = length;
  const cv::Point corner =
      style.upwards ? cv::Point(anchor.x - style.height / 2, anchor.y - (length - before))
                    : cv::Point(anchor.x - before, anchor.y - style.height / 2);
  const cv::Rect seen = cv::Rect(corner, ink.size()) & cv::Rect({}, picture.size());
  if (seen.empty()) return;
  cv::Mat share;
  ink(seen - corner).convertTo(share, CV_32F, 1 / 255.0);
  cv::Mat place = picture(seen);
  cv::blendLinear(BlankPicture(seen.width, seen.height, style.colour), place, share, 1 - share,
                  place);
}

}  // namespace silhouette
