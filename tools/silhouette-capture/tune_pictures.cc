// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/tune_pictures.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"

namespace silhouette {

Picture CameraPicture(const cv::Mat& image) {
  Picture picture = image.clone();
  if (image.channels() == 1) cv::cvtColor(image, picture, cv::COLOR_GRAY2BGR);
  return picture;
}

namespace {

constexpr int kWidth = 420;
constexpr int kColumns = 3;
constexpr double kOpacity = 0.6;

const Colour kGained = palette::kCaptured;
const Colour kLost = palette::kObstacle;

// How close decisions are: up to this many times the limit.
struct Closeness {
  double up_to;
  Colour colour;
  const char* text;
};
const Closeness kCloseness[] = {{0.35, {255, 255, 255}, "differs by up to 0.35 of its limit"},
                                {0.7, {215, 215, 215}, "0.7"},
                                {1, palette::kTight, "1: nearly found"},
                                {1.4, palette::kUnknown, "1.4: just found"},
                                {1e9, palette::kRobot, "more"}};

void Veil(Picture& picture, const cv::Mat& where, Colour colour) {
  Picture veil(picture.size(), CV_8UC3, BgrOf(colour));
  cv::addWeighted(picture, 1 - kOpacity, veil, kOpacity, 0, veil);
  veil.copyTo(picture, where);
}

Picture Fitted(const Picture& picture) {
  return FittedInto(picture, kWidth, std::max(1, kWidth * picture.rows / picture.cols));
}

Picture ClosenessPicture(const cv::Mat& over_limit) {
  Picture picture(over_limit.size(), CV_8UC3);
  for (auto each = std::rbegin(kCloseness); each != std::rend(kCloseness); ++each) {
    picture.setTo(BgrOf(each->colour), over_limit <= each->up_to);
  }
  return picture;
}

Picture FoundPicture(const cv::Mat& image, const cv::Mat& found, const cv::Mat& first) {
  Picture picture = CameraPicture(image);
  Veil(picture, found & first, palette::kRobot);
  Veil(picture, found & ~first, kGained);
  Veil(picture, first & ~found, kLost);
  return picture;
}

std::string Caption(const TuneVariant& variant, const TuneFigures& figures) {
  const double share = 100.0 * static_cast<double>(figures.foreground) /
                       static_cast<double>(std::max<int64_t>(figures.pixels, 1));
  std::string text = absl::StrFormat("%.2f %%", share);
  if (figures.gained > 0) absl::StrAppend(&text, ", +", figures.gained);
  if (figures.lost > 0) absl::StrAppend(&text, ", -", figures.lost);
  absl::StrAppend(&text, ": ", variant.name);
  return text;
}

}  // namespace

Picture TuneSheet(const TuneImage& image, const std::vector<TuneVariant>& variants,
                  const TunedImage& tuned) {
  std::vector<CaptionedPicture> pictures = {
      {Fitted(CameraPicture(image.image)), image.name},
      {Fitted(ClosenessPicture(tuned.steps.front().over_limit)),
       absl::StrCat("difference over limit, ", variants.front().name)}};
  for (size_t v = 0; v < variants.size(); ++v) {
    pictures.push_back({Fitted(FoundPicture(image.image, tuned.steps[v].foreground,
                                            tuned.steps.front().foreground)),
                        Caption(variants[v], tuned.figures[v])});
  }
  SheetOptions options{.title = "", .columns = kColumns, .legend = {}};
  options.legend = {{palette::kRobot, "found"},
                    {kGained, "found, not by " + variants.front().name},
                    {kLost, "found by " + variants.front().name + " only"}};
  for (const Closeness& each : kCloseness) options.legend.push_back({each.colour, each.text});
  return ContactSheet(pictures, options);
}

}  // namespace silhouette
