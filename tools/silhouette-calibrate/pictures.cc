// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"
#include "server/collision/epipolar_bands.h"

namespace silhouette {
namespace {

constexpr int kFraction = 4;  // bits of the fractions of coordinates that OpenCV draws at

cv::Scalar Bgr(Colour colour) { return {1. * colour.blue, 1. * colour.green, 1. * colour.red}; }

// A place in a picture with its fraction, as OpenCV takes it.
cv::Point Fine(const Eigen::Vector2d& place) {
  const Eigen::Vector2d bounded = (place * (1 << kFraction)).cwiseMax(-1e6).cwiseMin(1e6);
  return {cvRound(bounded.x()), cvRound(bounded.y())};
}

// A line from a dot at its beginning.
void DrawResidual(Picture& picture, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                  Colour colour, int thickness, int radius) {
  cv::line(picture, Fine(from), Fine(to), Bgr(colour), thickness, cv::LINE_AA, kFraction);
  cv::circle(picture, Fine(from), radius << kFraction, Bgr(colour), cv::FILLED, cv::LINE_AA,
             kFraction);
}

constexpr int kTileSide = 560;  // about, in pixels
constexpr std::array<Colour, 5> kColours = {palette::kObstacle, palette::kRobot, palette::kStart,
                                            palette::kGoal, palette::kTight};

// A pixel that is shown: where it is, and where the other view saw the same.
struct Shown {
  Eigen::Vector2d here = Eigen::Vector2d::Zero();  // pixels of the camera images
  std::optional<Eigen::Vector2d> there;
};

MaskSize MaskSizeOf(const PairedView& view) {
  return {view.sizes.mask.width, view.sizes.mask.height};
}

int MaskPixelOf(const PairedView& view, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d scaled = ScaledTo(pixel, view.sizes.image, view.sizes.mask);
  const MaskSize size = MaskSizeOf(view);
  const int x = std::clamp(static_cast<int>(std::lround(scaled.x())), 0, size.width - 1);
  const int y = std::clamp(static_cast<int>(std::lround(scaled.y())), 0, size.height - 1);
  return y * size.width + x;
}

// Corners that both saw, far from each other; else a few places of the image.
std::vector<Shown> PixelsToShow(const BandPictures& pictures, int here, int there) {
  const PairedView& view = pictures.views[static_cast<size_t>(here)];
  std::vector<TagSighting> of_frame;
  for (const TagSighting& sighting : pictures.sightings) {
    if (pictures.frame.empty() || sighting.frame == pictures.frame) of_frame.push_back(sighting);
  }
  const ViewPair seen =
      CornersOfPair(of_frame, view.name, pictures.views[static_cast<size_t>(there)].name);
  std::vector<Shown> shown;
  if (seen.corners.empty()) {
    const PixelSize size = view.sizes.image;
    for (const auto& [x, y] :
         {std::pair{0.25, 0.3}, {0.75, 0.3}, {0.5, 0.5}, {0.25, 0.75}, {0.75, 0.75}}) {
      shown.push_back({{x * size.width, y * size.height}, std::nullopt});
    }
    return shown;
  }
  const auto nearest = [&](const Correspondence& corner) {
    double least = 1e9;
    for (const Shown& other : shown) least = std::min(least, (corner.a - other.here).norm());
    return least;
  };
  while (shown.size() < std::min(kColours.size(), seen.corners.size())) {
    const Correspondence& next =
        *std::max_element(seen.corners.begin(), seen.corners.end(),
                          [&](const Correspondence& one, const Correspondence& other) {
                            return nearest(one) < nearest(other);
                          });
    shown.push_back({next.a, next.b});
  }
  return shown;
}

class BandTile {
 public:
  BandTile(const BandPictures& pictures, int view)
      : view_(pictures.views[static_cast<size_t>(view)]) {
    const PixelSize image = view_.sizes.image;
    const double scale = static_cast<double>(kTileSide) / std::max(image.width, image.height);
    const cv::Size size(static_cast<int>(std::lround(image.width * scale)),
                        static_cast<int>(std::lround(image.height * scale)));
    const auto found = pictures.images.find(view_.name);
    if (found == pictures.images.end()) {
      picture_ = BlankPicture(size.width, size.height, palette::kBackground);
    } else {
      cv::resize(found->second, picture_, size, 0, 0, cv::INTER_AREA);
    }
  }

  void Veil(const Mask& mask, Colour colour, double opacity) {
    picture_ = WithVeil(picture_, mask, colour, opacity);
  }

  // A ring about a pixel coordinate of the camera image.
  void Ring(const Eigen::Vector2d& pixel, Colour colour) {
    const Eigen::Vector2d at = ScaledTo(pixel, view_.sizes.image, {picture_.cols, picture_.rows});
    const cv::Point centre(static_cast<int>(std::lround(at.x())),
                           static_cast<int>(std::lround(at.y())));
    cv::circle(picture_, centre, 11, {255, 255, 255}, 4, cv::LINE_AA);
    cv::circle(picture_, centre, 11, Bgr(colour), 2, cv::LINE_AA);
    cv::circle(picture_, centre, 1, {34, 34, 34}, cv::FILLED, cv::LINE_AA);
  }

  const Picture& picture() const { return picture_; }

 private:
  const PairedView& view_;
  Picture picture_;
};

// The pixels in `here`, and beside them their bands in `there`.
void AddRow(const BandPictures& pictures, const EpipolarBands& bands, int here, int there,
            std::vector<CaptionedPicture>& tiles) {
  const PairedView& view = pictures.views[static_cast<size_t>(here)];
  const PairedView& other = pictures.views[static_cast<size_t>(there)];
  const std::vector<Shown> shown = PixelsToShow(pictures, here, there);
  BandTile pixels(pictures, here);
  BandTile across(pictures, there);
  int held = 0;
  int marked = 0;
  for (size_t i = 0; i < shown.size(); ++i) {
    const int pixel = MaskPixelOf(view, shown[i].here);
    const MaskSize size = MaskSizeOf(other);
    pixels.Veil(
        Mask::FromPredicate(MaskSizeOf(view),
                            [&](int x, int y) { return y * MaskSizeOf(view).width + x == pixel; }),
        kColours[i], 1);
    across.Veil(
        Mask::FromPredicate(
            size, [&](int x, int y) { return bands.Meet(here, pixel, there, y * size.width + x); }),
        kColours[i], 0.5);
    if (!shown[i].there) continue;
    ++marked;
    held += bands.Meet(here, pixel, there, MaskPixelOf(other, *shown[i].there)) ? 1 : 0;
  }
  for (size_t i = 0; i < shown.size(); ++i) {
    pixels.Ring(shown[i].here, kColours[i]);
    if (shown[i].there) across.Ring(*shown[i].there, kColours[i]);
  }
  tiles.push_back({pixels.picture(), absl::StrCat(view.name, ": pixels")});
  std::string caption = absl::StrCat(other.name, ": their bands");
  if (marked > 0) {
    absl::StrAppend(&caption, "; ", held, " of ", marked, " hold the ringed corner");
  }
  tiles.push_back({across.picture(), caption});
}

constexpr int kHeading = 34;
constexpr int kLeastWidth = 960;  // of a picture; smaller images are enlarged

// An image's coordinates in a picture that shows each pixel `scale` times as large.
struct Placement {
  int scale = 1;
  int top = 0;

  cv::Point At(const Eigen::Vector2d& pixel) const {
    return Fine({(pixel.x() + 0.5) * scale - 0.5, (pixel.y() + 0.5) * scale - 0.5 + top});
  }
  cv::Point Whole(const Eigen::Vector2d& pixel) const {
    const cv::Point at = At(pixel);
    return {at.x >> kFraction, at.y >> kFraction};
  }
};

void DrawTag(Picture& picture, const Placement& place, const DetectedTag& tag, Colour colour) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (int i = 0; i < 4; ++i) {
    middle += tag.corners[i] / 4;
    cv::line(picture, place.At(tag.corners[i]), place.At(tag.corners[(i + 1) % 4]), Bgr(colour), 1,
             cv::LINE_AA, kFraction);
  }
  const int radius = 3 << kFraction;
  for (int i = 0; i < 4; ++i) {
    cv::circle(picture, place.At(tag.corners[i]), radius, Bgr(i == 0 ? palette::kGoal : colour),
               i == 0 ? cv::FILLED : 1, cv::LINE_AA, kFraction);
  }
  const double size = tag.size * place.scale;
  const int height = std::clamp(static_cast<int>(size / 3), 10, 22);
  const auto label = [&](const std::string& text, int line, int line_height) {
    const int width = TextWidth(text, line_height);
    if (width > 1.2 * size) return;
    cv::Point at = place.Whole(middle);
    at.y += line;
    cv::rectangle(picture, {at.x - width / 2 - 2, at.y - line_height / 2},
                  {at.x + width / 2 + 2, at.y + line_height / 2}, Bgr(palette::kPaper), cv::FILLED);
    DrawText(picture, text, at,
             {.height = line_height, .colour = colour, .across = Align::kMiddle});
  };
  label(absl::StrCat(tag.tag), 0, height);
  label(absl::StrFormat("%.3f", tag.sigma), height, std::max(10, height * 2 / 3));
}

constexpr int kPoseWidth = 960;  // of the picture, pixels
constexpr double kTypicalResidual =
    18;  // length of a root-mean-square residual, pixels of the picture
constexpr Colour kArrow = palette::kRobot;
constexpr Colour kOutlierColour = palette::kObstacle;

// The largest of 1, 2 and 5 times a power of ten that is not above `value`.
double Round(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {5.0, 2.0}) {
    if (step * power <= value) return step * power;
  }
  return power;
}

constexpr int kFieldsX = 24;
constexpr int kFieldsY = 18;
constexpr double kLensWidth = 1100;  // of the drawn image
constexpr int kMargin = 20;
constexpr int kLine = 22;

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
  const auto at = [&](const Eigen::Vector2d& pixel) {
    return Eigen::Vector2d((pixel + Eigen::Vector2d(0.5, 0.5)) * scale);
  };
  for (const LensResidual& r : solution.residuals) {
    if (r.camera != camera || r.outlier != outliers || !r.residual.allFinite()) continue;
    DrawResidual(image, at(r.seen), at(r.seen + longer * r.residual),
                 outliers ? palette::kObstacle : palette::kRobot, 1, outliers ? 3 : 1);
  }
}

constexpr int kSide = 760;           // about, in pixels
constexpr double kLongest = 60;      // of an arrow
constexpr double kMostLonger = 500;  // arrows are lengthened by no more

}  // namespace

Picture PaintBands(const BandPictures& pictures, int a, int b) {
  std::vector<MaskSize> sizes;
  for (const PairedView& view : pictures.views) sizes.push_back(MaskSizeOf(view));
  const EpipolarBands bands(pictures.calibration, sizes, pictures.margin);
  std::vector<CaptionedPicture> tiles;
  AddRow(pictures, bands, a, b, tiles);
  AddRow(pictures, bands, b, a, tiles);
  std::string title = absl::StrCat(pictures.views[static_cast<size_t>(a)].name, " and ",
                                   pictures.views[static_cast<size_t>(b)].name);
  absl::StrAppendFormat(&title, ": epipolar bands, margin %.3g mask pixels", pictures.margin);
  if (!pictures.frame.empty()) absl::StrAppend(&title, "; corners of frame ", pictures.frame);
  return ContactSheet(tiles, {.title = title, .columns = 2, .legend = {}});
}

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
      const cv::Scalar fill = Bgr(palette::kPaper) * (1 - share) + Bgr(palette::kRobot) * share;
      cv::rectangle(picture, from, to, count == 0 ? Bgr(palette::kBackground) : fill, cv::FILLED);
      cv::rectangle(picture, from, to, Bgr(palette::kFaint), 1);
      DrawText(picture, absl::StrCat(count), {to.x - 6, to.y - 10},
               {.height = 14, .colour = palette::kInk, .across = Align::kEnd});
    }
  }
  for (const Eigen::Vector2d& corner : coverage.corners()) {
    const cv::Point at(10 + static_cast<int>((corner.x() + 0.5) * scale),
                       kHeading + static_cast<int>((corner.y() + 0.5) * scale));
    cv::circle(picture, at, 1, Bgr(palette::kInk), cv::FILLED, cv::LINE_AA);
  }
  DrawText(picture,
           absl::StrFormat("%s: %d corners, seen in %.0f %% of the image's %d cells", view,
                           coverage.corners().size(), 100 * coverage.Share(),
                           Coverage::kColumns * Coverage::kRows),
           {10, kHeading / 2}, {.height = 18});
  return picture;
}

Picture ResidualPicture(const PoseProblem& problem, const PoseSolution& solution, size_t view) {
  const PoseView& seen_by = problem.views[view];
  const SolvedView& solved = solution.views[view];
  const double shrink = static_cast<double>(kPoseWidth) / seen_by.lens.width;
  const int height = static_cast<int>(std::lround(shrink * seen_by.lens.height));
  const double magnify = kTypicalResidual / std::max(1e-6, std::sqrt(2.0) * solved.rms_px);
  Picture picture = BlankPicture(kPoseWidth, height, palette::kFree);
  cv::rectangle(picture, {0, 0}, {kPoseWidth - 1, height - 1}, Bgr(palette::kFaint));
  for (const CornerResidual& corner : solution.residuals) {
    const TagSighting& seen = problem.sightings[corner.sighting];
    if (seen.view != seen_by.name) continue;
    const Eigen::Vector2d from =
        shrink * (seen.corners[static_cast<size_t>(corner.corner)].array() + 0.5).matrix();
    const Eigen::Vector2d line = corner.residual.allFinite()
                                     ? Eigen::Vector2d(magnify * corner.residual)
                                     : Eigen::Vector2d::Zero();
    const Eigen::Vector2d to = from + line * std::min(1.0, 120 / std::max(1e-9, line.norm()));
    DrawResidual(picture, from, to, corner.outlier ? kOutlierColour : kArrow,
                 corner.outlier ? 2 : 1, 2);
  }
  const double bar = Round(120 / magnify);
  const cv::Point start(20, height - 20);
  cv::line(picture, start, {20 + static_cast<int>(std::lround(bar * magnify)), height - 20},
           Bgr(palette::kInk), 2);
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

Picture ResidualPicture(const LensSolution& solution, size_t camera) {
  const SolvedCamera& solved = solution.cameras[camera];
  const double scale = kLensWidth / solved.width;
  Picture image = BlankPicture(static_cast<int>(kLensWidth), cvRound(solved.height * scale));
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
                Bgr(palette::kFaint), 1);
  DrawLegend(sheet, legend, kMargin, place.y + place.height + 8, image.cols / 4 * 3);
  // A measure of what the lines' lengths say, pixels.
  const double measure = 50.0 / longer;
  const int length = cvRound(measure * longer * scale);
  const int y = place.y + place.height + 8 + kLine / 2;
  const int right = kMargin + image.cols;
  cv::line(sheet, {right - length, y}, {right, y}, Bgr(palette::kInk), 2);
  DrawText(sheet, absl::StrFormat("%g px", measure), {right - length - 8, y},
           {.across = Align::kEnd});
  return sheet;
}

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
                    Bgr(moved ? palette::kObstacle : palette::kRobot), 2, cv::LINE_AA, 0, 0.2);
    cv::circle(picture, begin, 2, Bgr(palette::kInk), cv::FILLED, cv::LINE_AA);
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
