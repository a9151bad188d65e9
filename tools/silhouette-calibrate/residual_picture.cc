#include "tools/silhouette-calibrate/residual_picture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"

namespace silhouette {
namespace {

constexpr int kResidualPictureWidth = 960;  // of the picture, pixels
constexpr double kTypical = 18;  // length of a root-mean-square residual, pixels of the picture
constexpr int kFraction = 4;     // bits of the coordinates' fractions
constexpr Colour kArrow = palette::kRobot;
constexpr Colour kOutlierColour = palette::kObstacle;

cv::Scalar ScalarOf(Colour colour) {
  return {1.0 * colour.blue, 1.0 * colour.green, 1.0 * colour.red};
}

cv::Point Fine(const Eigen::Vector2d& point) {
  const double scale = 1 << kFraction;
  return {static_cast<int>(std::lround(point.x() * scale)),
          static_cast<int>(std::lround(point.y() * scale))};
}

// The largest of 1, 2 and 5 times a power of ten that is not above `value`.
double Round(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {5.0, 2.0}) {
    if (step * power <= value) return step * power;
  }
  return power;
}

}  // namespace

Picture ResidualPicture(const PoseProblem& problem, const PoseSolution& solution, size_t view) {
  const PoseView& seen_by = problem.views[view];
  const SolvedView& solved = solution.views[view];
  const double shrink = static_cast<double>(kResidualPictureWidth) / seen_by.lens.width;
  const int height = static_cast<int>(std::lround(shrink * seen_by.lens.height));
  const double magnify = kTypical / std::max(1e-6, std::sqrt(2.0) * solved.rms_px);
  Picture picture = BlankPicture(kResidualPictureWidth, height, palette::kFree);
  cv::rectangle(picture, {0, 0}, {kResidualPictureWidth - 1, height - 1},
                ScalarOf(palette::kFaint));
  for (const CornerResidual& corner : solution.residuals) {
    const TagSighting& seen = problem.sightings[corner.sighting];
    if (seen.view != seen_by.name) continue;
    const Eigen::Vector2d from =
        shrink * (seen.corners[static_cast<size_t>(corner.corner)].array() + 0.5).matrix();
    const Eigen::Vector2d line = corner.residual.allFinite()
                                     ? Eigen::Vector2d(magnify * corner.residual)
                                     : Eigen::Vector2d::Zero();
    const Eigen::Vector2d to = from + line * std::min(1.0, 120 / std::max(1e-9, line.norm()));
    const cv::Scalar colour = ScalarOf(corner.outlier ? kOutlierColour : kArrow);
    cv::circle(picture, Fine(from), 2 << kFraction, colour, cv::FILLED, cv::LINE_AA, kFraction);
    cv::line(picture, Fine(from), Fine(to), colour, corner.outlier ? 2 : 1, cv::LINE_AA, kFraction);
  }
  const double bar = Round(120 / magnify);
  const cv::Point start(20, height - 20);
  cv::line(picture, start, {20 + static_cast<int>(std::lround(bar * magnify)), height - 20},
           ScalarOf(palette::kInk), 2);
  DrawText(picture, absl::StrFormat("%g px", bar), {20, height - 32}, {.height = 14});
  SheetOptions options{
      .title = absl::StrFormat("%s: residuals, %.0f times as long", seen_by.name, magnify / shrink),
      .columns = 1,
      .legend = {{kArrow, "corner: from where it was seen to where it should be"},
                 {kOutlierColour, "left out"}}};
  return ContactSheet({{picture, absl::StrFormat("%d corners, %.3f px rms per axis, %d left out",
                                                 solved.corners, solved.rms_px, solved.outliers)}},
                      options);
}

}  // namespace silhouette
