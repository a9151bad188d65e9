#include "tools/silhouette-calibrate/detect_pictures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"

namespace silhouette {
namespace {

constexpr int kShift = 4;  // cv draws at sixteenths of a pixel
constexpr int kHeading = 34;
constexpr int kLeastWidth = 960;  // of a picture; smaller images are enlarged

cv::Scalar DetectPicturesBgr(Colour colour) {
  return {1. * colour.blue, 1. * colour.green, 1. * colour.red};
}

// An image's coordinates in a picture that shows each pixel `scale` times as large.
struct Placement {
  int scale = 1;
  int top = 0;

  cv::Point At(const Eigen::Vector2d& pixel) const {
    const double one = 1 << kShift;
    return {static_cast<int>(std::lround(((pixel.x() + 0.5) * scale - 0.5) * one)),
            static_cast<int>(std::lround(((pixel.y() + 0.5) * scale - 0.5 + top) * one))};
  }
  cv::Point Whole(const Eigen::Vector2d& pixel) const {
    const cv::Point at = At(pixel);
    return {at.x >> kShift, at.y >> kShift};
  }
};

void DrawTag(Picture& picture, const Placement& place, const DetectedTag& tag, Colour colour) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (int i = 0; i < 4; ++i) {
    middle += tag.corners[i] / 4;
    cv::line(picture, place.At(tag.corners[i]), place.At(tag.corners[(i + 1) % 4]),
             DetectPicturesBgr(colour), 1, cv::LINE_AA, kShift);
  }
  const int radius = 3 << kShift;
  for (int i = 0; i < 4; ++i) {
    cv::circle(picture, place.At(tag.corners[i]), radius,
               DetectPicturesBgr(i == 0 ? palette::kGoal : colour), i == 0 ? cv::FILLED : 1,
               cv::LINE_AA, kShift);
  }
  const double size = tag.size * place.scale;
  const int height = std::clamp(static_cast<int>(size / 3), 10, 22);
  const auto label = [&](const std::string& text, int line, int line_height) {
    const int width = TextWidth(text, line_height);
    if (width > 1.2 * size) return;
    cv::Point at = place.Whole(middle);
    at.y += line;
    cv::rectangle(picture, {at.x - width / 2 - 2, at.y - line_height / 2},
                  {at.x + width / 2 + 2, at.y + line_height / 2},
                  DetectPicturesBgr(palette::kPaper), cv::FILLED);
    DrawText(picture, text, at,
             {.height = line_height, .colour = colour, .across = Align::kMiddle});
  };
  label(absl::StrCat(tag.tag), 0, height);
  label(absl::StrFormat("%.3f", tag.sigma), height, std::max(10, height * 2 / 3));
}

}  // namespace

Picture PictureOfTags(const cv::Mat& image, const ImageTags& tags) {
  const int scale = std::max(1, (kLeastWidth + image.cols - 1) / image.cols);
  const std::vector<LegendEntry> legend = {{palette::kRobot, "fitted to its edges"},
                                           {palette::kObstacle, "the AprilTag library's corners"},
                                           {palette::kIgnored, "left out"},
                                           {palette::kGoal, "corner 0"}};
  const int width = image.cols * scale;
  const int below = LegendHeight(legend, width - 20) + 12;
  Picture picture = BlankPicture(width, image.rows * scale + kHeading + below);
  cv::Mat enlarged;
  cv::resize(image, enlarged, {}, scale, scale, cv::INTER_NEAREST);
  cv::cvtColor(enlarged, enlarged, cv::COLOR_GRAY2BGR);
  // Paler, so that lines stand out.
  enlarged = 0.6 * enlarged + cv::Scalar::all(0.4 * 255);
  enlarged.copyTo(picture.rowRange(kHeading, kHeading + enlarged.rows));
  const Placement place{scale, kHeading};
  for (const DetectedTag& tag : tags.foreign) DrawTag(picture, place, tag, palette::kIgnored);
  for (const DetectedTag& tag : tags.ambiguous) DrawTag(picture, place, tag, palette::kIgnored);
  for (const DetectedTag& tag : tags.tags) {
    DrawTag(picture, place, tag, tag.fitted ? palette::kRobot : palette::kObstacle);
  }
  std::string title = absl::StrCat(tags.view, " ", tags.frame, ": ", tags.tags.size(), " of ",
                                   tags.expected, " tags");
  if (!tags.tags.empty()) {
    absl::StrAppend(&title,
                    absl::StrFormat(", sigma %.3f px, blur %.2f px (in the tags: id, sigma)",
                                    tags.TypicalSigma(), tags.MedianBlur()));
  }
  DrawText(picture, Shortened(title, width - 20, 18), {10, kHeading / 2}, {.height = 18});
  DrawLegend(picture, legend, 10, picture.rows - below + 6, width - 20);
  return picture;
}

Picture PictureOfCoverage(const std::string& view, const Coverage& coverage) {
  const int width = 960;
  const double scale = static_cast<double>(width) / coverage.size().width;
  const int height = static_cast<int>(std::lround(coverage.size().height * scale));
  Picture picture = BlankPicture(width + 20, height + kHeading + 10);
  int most = 1;
  for (int row = 0; row < Coverage::kRows; ++row) {
    for (int column = 0; column < Coverage::kColumns; ++column) {
      most = std::max(most, coverage.Count(column, row));
    }
  }
  for (int row = 0; row < Coverage::kRows; ++row) {
    for (int column = 0; column < Coverage::kColumns; ++column) {
      const cv::Point from(10 + column * width / Coverage::kColumns,
                           kHeading + row * height / Coverage::kRows);
      const cv::Point to(10 + (column + 1) * width / Coverage::kColumns - 1,
                         kHeading + (row + 1) * height / Coverage::kRows - 1);
      const int count = coverage.Count(column, row);
      // From white to a light blue with the number of corners.
      const double share = count == 0 ? 0 : 0.15 + 0.35 * count / most;
      const cv::Scalar fill = DetectPicturesBgr(palette::kPaper) * (1 - share) +
                              DetectPicturesBgr(palette::kRobot) * share;
      cv::rectangle(picture, from, to, count == 0 ? DetectPicturesBgr(palette::kBackground) : fill,
                    cv::FILLED);
      cv::rectangle(picture, from, to, DetectPicturesBgr(palette::kFaint), 1);
      DrawText(picture, absl::StrCat(count), {to.x - 6, to.y - 10},
               {.height = 14, .colour = palette::kInk, .across = Align::kEnd});
    }
  }
  for (const Eigen::Vector2d& corner : coverage.corners()) {
    const cv::Point at(10 + static_cast<int>((corner.x() + 0.5) * scale),
                       kHeading + static_cast<int>((corner.y() + 0.5) * scale));
    cv::circle(picture, at, 1, DetectPicturesBgr(palette::kInk), cv::FILLED, cv::LINE_AA);
  }
  DrawText(picture,
           absl::StrFormat("%s: %d corners, seen in %.0f %% of the image's %d cells", view,
                           coverage.corners().size(), 100 * coverage.Share(),
                           Coverage::kColumns * Coverage::kRows),
           {10, kHeading / 2}, {.height = 18});
  return picture;
}

}  // namespace silhouette
