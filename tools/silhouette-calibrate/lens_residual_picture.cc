#include "tools/silhouette-calibrate/lens_residual_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"

namespace silhouette {
namespace {

constexpr int kFieldsX = 24;
constexpr int kFieldsY = 18;
constexpr double kLensResidualPictureWidth = 1100;  // of the drawn image
constexpr int kMargin = 20;
constexpr int kLine = 22;

cv::Scalar LensResidualPictureBgr(Colour colour) {
  return {double(colour.blue), double(colour.green), double(colour.red)};
}

// How many times as long as they are residuals are drawn.
int LongerBy(const SolvedCamera& camera) {
  if (camera.rms < 0.03) return 500;
  return camera.rms < 0.4 ? 100 : 10;
}

void DrawCoverage(Picture& image, const LensSolution& solution, size_t camera) {
  const SolvedCamera& solved = solution.cameras[camera];
  std::array<int, kFieldsX * kFieldsY> counts{};
  for (const LensResidual& r : solution.residuals) {
    if (r.camera != camera || r.outlier) continue;
    const auto field = [](double at, int size, int fields) {
      return std::clamp(static_cast<int>((at + 0.5) / size * fields), 0, fields - 1);
    };
    ++counts[static_cast<size_t>(field(r.seen.x(), solved.width, kFieldsX) +
                                 kFieldsX * field(r.seen.y(), solved.height, kFieldsY))];
  }
  for (int y = 0; y < kFieldsY; ++y) {
    for (int x = 0; x < kFieldsX; ++x) {
      const int count = counts[static_cast<size_t>(x + kFieldsX * y)];
      if (count == 0) continue;
      // Few corners matter more than many.
      const double shade = std::min(1.0, std::log2(1.0 + count) / 6);
      const double light = 246 - 46 * shade;
      const cv::Point from(image.cols * x / kFieldsX, image.rows * y / kFieldsY);
      const cv::Point to(image.cols * (x + 1) / kFieldsX, image.rows * (y + 1) / kFieldsY);
      cv::rectangle(image, cv::Rect(from, to), {light, light, light}, cv::FILLED);
    }
  }
}

void DrawResiduals(Picture& image, const LensSolution& solution, size_t camera, double scale,
                   bool outliers) {
  const double longer = LongerBy(solution.cameras[camera]);
  constexpr int kLensShift = 4;  // fractional bits of drawn coordinates
  const auto fixed = [&](const Eigen::Vector2d& at) {
    const Eigen::Vector2d drawn = (at + Eigen::Vector2d(0.5, 0.5)) * scale * (1 << kLensShift);
    const Eigen::Vector2d bounded = drawn.cwiseMax(-1e6).cwiseMin(1e6);
    return cv::Point(cvRound(bounded.x()), cvRound(bounded.y()));
  };
  for (const LensResidual& r : solution.residuals) {
    if (r.camera != camera || r.outlier != outliers || !r.residual.allFinite()) continue;
    const cv::Scalar colour =
        LensResidualPictureBgr(outliers ? palette::kObstacle : palette::kRobot);
    const Eigen::Vector2d end = r.seen + longer * r.residual;
    cv::line(image, fixed(r.seen), fixed(end), colour, 1, cv::LINE_AA, kLensShift);
    cv::circle(image, fixed(r.seen), (outliers ? 3 : 1) << kLensShift, colour, cv::FILLED,
               cv::LINE_AA, kLensShift);
  }
}

}  // namespace

Picture ResidualPicture(const LensSolution& solution, size_t camera) {
  const SolvedCamera& solved = solution.cameras[camera];
  const double scale = kLensResidualPictureWidth / solved.width;
  Picture image =
      BlankPicture(static_cast<int>(kLensResidualPictureWidth), cvRound(solved.height * scale));
  DrawCoverage(image, solution, camera);
  DrawResiduals(image, solution, camera, scale, false);
  DrawResiduals(image, solution, camera, scale, true);

  const int longer = LongerBy(solved);
  const std::vector<LegendEntry> legend = {
      {palette::kRobot, absl::StrFormat("residual, %d times as long", longer)},
      {palette::kObstacle, "left out"},
      {Colour{200, 200, 200}, "corners seen: many"},
      {Colour{240, 240, 240}, "few"},
      {palette::kPaper, "none"}};
  const int foot = LegendHeight(legend, image.cols) + kLine;
  const int head = 3 * kLine;
  Picture sheet = BlankPicture(image.cols + 2 * kMargin, image.rows + 2 * kMargin + head + foot);
  DrawText(sheet, "Residuals of " + solved.name, {kMargin, kMargin + 8}, {.height = 20});
  DrawText(sheet,
           absl::StrFormat(
               "%d images, %d corners, %d left out; rms %.3f px per axis; %.0f %% of the "
               "image seen",
               solved.images, solved.corners, solved.outliers, solved.rms, 100 * solved.covered),
           {kMargin, kMargin + 8 + kLine}, {});
  const cv::Rect place(kMargin, kMargin + head - kLine / 2, image.cols, image.rows);
  image.copyTo(sheet(place));
  cv::rectangle(sheet, cv::Rect(place.x - 1, place.y - 1, place.width + 2, place.height + 2),
                LensResidualPictureBgr(palette::kFaint), 1);
  DrawLegend(sheet, legend, kMargin, place.y + place.height + 8, image.cols / 4 * 3);
  // A measure of what the lines' lengths say, pixels.
  const double measure = 50.0 / longer;
  const int length = cvRound(measure * longer * scale);
  const int y = place.y + place.height + 8 + kLine / 2;
  const int right = kMargin + image.cols;
  cv::line(sheet, {right - length, y}, {right, y}, LensResidualPictureBgr(palette::kInk), 2);
  DrawText(sheet, absl::StrFormat("%g px", measure), {right - length - 8, y},
           {.across = Align::kEnd});
  return sheet;
}

}  // namespace silhouette
