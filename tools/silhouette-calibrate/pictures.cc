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
#include "common/numbers/numbers.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"
#include "server/collision/epipolar_bands.h"

namespace silhouette {
namespace {

constexpr int kFraction = 4;    // bits of the fractions of coordinates that OpenCV draws at
constexpr int kTileSide = 560;  // about, in pixels
constexpr std::array<Colour, 5> kColours = {palette::kObstacle, palette::kRobot, palette::kStart,
                                            palette::kGoal, palette::kTight};

// An image's coordinate in a picture that shows it `scale` times as large, with its fraction, as
// OpenCV draws it.
cv::Point Fine(const Eigen::Vector2d& pixel, double scale) {
  const Eigen::Vector2d place = ((pixel.array() + 0.5) * scale - 0.5) * (1 << kFraction);
  const Eigen::Vector2d bounded = place.cwiseMax(-1e6).cwiseMin(1e6);
  return {cvRound(bounded.x()), cvRound(bounded.y())};
}

void DrawDot(Picture& picture, cv::Point at, int radius, Colour colour,
             int thickness = cv::FILLED) {
  cv::circle(picture, at, radius << kFraction, BgrOf(colour), thickness, cv::LINE_AA, kFraction);
}

Picture BlankFor(PixelSize image, double scale, Colour colour) {
  return BlankPicture(cvRound(image.width * scale), cvRound(image.height * scale), colour);
}

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
  const int x = std::clamp(cvRound(scaled.x()), 0, size.width - 1);
  const int y = std::clamp(cvRound(scaled.y()), 0, size.height - 1);
  return y * size.width + x;
}

// Corners that both saw, far from each other; else a few places of the image.
std::vector<Shown> PixelsToShow(const BandPictures& pictures, const PairedView& view,
                                const PairedView& other) {
  std::vector<TagSighting> of_frame;
  for (const TagSighting& sighting : pictures.sightings) {
    if (pictures.frame.empty() || sighting.frame == pictures.frame) of_frame.push_back(sighting);
  }
  const ViewPair seen = CornersOfPair(of_frame, view.name, other.name);
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
    for (const Shown& known : shown) least = std::min(least, (corner.a - known.here).norm());
    return least;
  };
  while (shown.size() < std::min(kColours.size(), seen.corners.size())) {
    const Correspondence& next = *std::ranges::max_element(seen.corners, {}, nearest);
    shown.push_back({next.a, next.b});
  }
  return shown;
}

double TileScale(const PairedView& view) {
  return 1.0 * kTileSide / std::max(view.sizes.image.width, view.sizes.image.height);
}

// A view's image, or a plain field where there is none.
Picture TileOf(const BandPictures& pictures, const PairedView& view) {
  Picture tile = BlankFor(view.sizes.image, TileScale(view), palette::kBackground);
  if (const auto found = pictures.images.find(view.name); found != pictures.images.end()) {
    cv::resize(found->second, tile, tile.size(), 0, 0, cv::INTER_AREA);
  }
  return tile;
}

// A ring around a pixel coordinate of the camera image.
void DrawRing(Picture& tile, const PairedView& view, const Eigen::Vector2d& pixel, Colour colour) {
  const cv::Point at = Fine(pixel, TileScale(view));
  DrawDot(tile, at, 11, palette::kPaper, 4);
  DrawDot(tile, at, 11, colour, 2);
  DrawDot(tile, at, 1, palette::kInk);
}

// The pixels in `here`, and beside them their bands in `there`.
void AddRow(const BandPictures& pictures, const EpipolarBands& bands, int here, int there,
            std::vector<CaptionedPicture>& tiles) {
  const PairedView& view = pictures.views[static_cast<size_t>(here)];
  const PairedView& other = pictures.views[static_cast<size_t>(there)];
  const MaskSize size = MaskSizeOf(view);
  const MaskSize other_size = MaskSizeOf(other);
  const std::vector<Shown> shown = PixelsToShow(pictures, view, other);
  Picture pixels = TileOf(pictures, view);
  Picture across = TileOf(pictures, other);
  int held = 0;
  int marked = 0;
  for (size_t i = 0; i < shown.size(); ++i) {
    const int pixel = MaskPixelOf(view, shown[i].here);
    const auto is_pixel = [&](int x, int y) { return y * size.width + x == pixel; };
    const auto in_band = [&](int x, int y) {
      return bands.Meet(here, pixel, there, y * other_size.width + x);
    };
    pixels = WithVeil(pixels, Mask::FromPredicate(size, is_pixel), kColours[i], 1);
    across = WithVeil(across, Mask::FromPredicate(other_size, in_band), kColours[i], 0.5);
    if (!shown[i].there) continue;
    ++marked;
    held += bands.Meet(here, pixel, there, MaskPixelOf(other, *shown[i].there)) ? 1 : 0;
  }
  for (size_t i = 0; i < shown.size(); ++i) {
    DrawRing(pixels, view, shown[i].here, kColours[i]);
    if (shown[i].there) DrawRing(across, other, *shown[i].there, kColours[i]);
  }
  tiles.push_back({pixels, absl::StrCat(view.name, ": pixels")});
  std::string caption = absl::StrCat(other.name, ": their bands");
  if (marked > 0) {
    absl::StrAppend(&caption, "; ", held, " of ", marked, " hold the ringed corner");
  }
  tiles.push_back({across, caption});
}

constexpr int kLeastWidth = 960;  // of a picture; smaller images are enlarged

void DrawTag(Picture& picture, int scale, const DetectedTag& tag, Colour colour) {
  const size_t corners = tag.corners.size();
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < corners; ++i) {
    middle += tag.corners[i] / static_cast<double>(corners);
    cv::line(picture, Fine(tag.corners[i], scale), Fine(tag.corners[(i + 1) % corners], scale),
             BgrOf(colour), 1, cv::LINE_AA, kFraction);
  }
  if (corners == 1) {  // a corner or circle: the first one says how the board lies
    DrawDot(picture, Fine(middle, scale), 3, tag.tag == 0 ? palette::kGoal : colour,
            tag.tag == 0 ? cv::FILLED : 1);
    return;
  }
  for (size_t i = 0; i < corners; ++i) {
    DrawDot(picture, Fine(tag.corners[i], scale), 3, i == 0 ? palette::kGoal : colour,
            i == 0 ? cv::FILLED : 1);
  }
  const double size = tag.size * scale;
  const int height = std::clamp(static_cast<int>(size / 3), 10, 22);
  const auto label = [&](const std::string& text, int line, int line_height) {
    const int width = TextWidth(text, line_height);
    if (width > 1.2 * size) return;
    const cv::Point fine = Fine(middle, scale);
    const cv::Point at(fine.x >> kFraction, (fine.y >> kFraction) + line);
    cv::rectangle(picture, {at.x - width / 2 - 2, at.y - line_height / 2},
                  {at.x + width / 2 + 2, at.y + line_height / 2}, BgrOf(palette::kPaper),
                  cv::FILLED);
    DrawText(picture, text, at,
             {.height = line_height, .colour = colour, .across = Align::kMiddle});
  };
  label(absl::StrCat(tag.tag), 0, height);
  label(absl::StrFormat("%.3f", tag.sigma), height, std::max(10, height * 2 / 3));
}

constexpr int kFieldsX = 24;
constexpr int kFieldsY = 18;
constexpr double kTypicalResidual = 18;  // length of a root-mean-square one in the picture, pixels

// The image's fields, darker the more corners they have, white without any.
Picture FieldsOf(PixelSize image, const std::vector<LensResidual>& residuals, double scale) {
  cv::Mat_<int> counts = cv::Mat_<int>::zeros(kFieldsY, kFieldsX);
  const auto field = [](double at, int size, int fields) {
    return std::clamp(static_cast<int>((at + 0.5) / size * fields), 0, fields - 1);
  };
  for (const LensResidual& r : residuals) {
    if (r.outlier) continue;
    ++counts(field(r.seen.y(), image.height, kFieldsY), field(r.seen.x(), image.width, kFieldsX));
  }
  cv::Mat_<uint8_t> grey(counts.size());
  std::transform(counts.begin(), counts.end(), grey.begin(), [](int count) {
    // Few corners matter more than many.
    const double shade = std::min(1.0, std::log2(1.0 + count) / 6);
    return static_cast<uint8_t>(count == 0 ? 255 : 246 - 46 * shade);
  });
  Picture picture = BlankFor(image, scale, palette::kPaper);
  cv::resize(grey, grey, picture.size(), 0, 0, cv::INTER_NEAREST);
  cv::cvtColor(grey, picture, cv::COLOR_GRAY2BGR);
  return picture;
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
  std::string title = absl::StrFormat("%s and %s: epipolar bands, margin %.3g mask pixels",
                                      pictures.views[static_cast<size_t>(a)].name,
                                      pictures.views[static_cast<size_t>(b)].name, pictures.margin);
  if (!pictures.frame.empty()) absl::StrAppend(&title, "; corners of frame ", pictures.frame);
  return ContactSheet(tiles, {.title = title, .columns = 2, .legend = {}});
}

Picture PictureOfTags(const cv::Mat& image, const ImageTags& tags) {
  const int scale = std::max(1, (kLeastWidth + image.cols - 1) / image.cols);
  Picture picture = Enlarged(image, scale);
  cv::cvtColor(picture, picture, cv::COLOR_GRAY2BGR);
  // Paler, so that lines stand out.
  picture = 0.6 * picture + cv::Scalar::all(0.4 * 255);
  for (const DetectedTag& tag : tags.foreign) DrawTag(picture, scale, tag, palette::kIgnored);
  for (const DetectedTag& tag : tags.ambiguous) DrawTag(picture, scale, tag, palette::kIgnored);
  for (const DetectedTag& tag : tags.tags) {
    DrawTag(picture, scale, tag, tag.fitted ? palette::kRobot : palette::kObstacle);
  }
  std::string title = absl::StrCat(tags.view, " ", tags.frame, ": ", tags.tags.size(), " of ",
                                   tags.expected, " tags");
  if (!tags.tags.empty()) {
    absl::StrAppendFormat(&title, ", sigma %.3f px", tags.TypicalSigma());
    if (tags.MedianBlur() > 0) absl::StrAppendFormat(&title, ", blur %.2f px", tags.MedianBlur());
    absl::StrAppend(&title, " (in the tags: id, sigma)");
  }
  return ContactSheet({{picture, ""}},
                      {.title = title,
                       .columns = 1,
                       .legend = {{palette::kRobot, "fitted to its edges"},
                                  {palette::kObstacle, "the AprilTag library's corners"},
                                  {palette::kIgnored, "left out"},
                                  {palette::kGoal, "corner 0"}}});
}

Picture PictureOfCoverage(const std::string& view, const Coverage& coverage) {
  const double scale = 1.0 * kLeastWidth / coverage.size().width;
  Picture picture =
      BlankFor({coverage.size().width, coverage.size().height}, scale, palette::kBackground);
  int most = 1;
  for (int i = 0; i < Coverage::kRows * Coverage::kColumns; ++i) {
    most = std::max(most, coverage.Count(i % Coverage::kColumns, i / Coverage::kColumns));
  }
  for (int row = 0; row < Coverage::kRows; ++row) {
    for (int column = 0; column < Coverage::kColumns; ++column) {
      const cv::Rect field(cv::Point(column * picture.cols / Coverage::kColumns,
                                     row * picture.rows / Coverage::kRows),
                           cv::Point((column + 1) * picture.cols / Coverage::kColumns,
                                     (row + 1) * picture.rows / Coverage::kRows));
      const int count = coverage.Count(column, row);
      // From white to a light blue with the number of corners.
      const double share = 0.15 + 0.35 * count / most;
      if (count > 0) {
        picture(field) = BgrOf(palette::kPaper) * (1 - share) + BgrOf(palette::kRobot) * share;
      }
      cv::rectangle(picture, field, BgrOf(palette::kFaint), 1);
      DrawText(picture, absl::StrCat(count), field.br() - cv::Point(7, 11),
               {.height = 14, .across = Align::kEnd});
    }
  }
  for (const Eigen::Vector2d& corner : coverage.corners()) {
    DrawDot(picture, Fine(corner, scale), 1, palette::kInk);
  }
  return ContactSheet(
      {{picture, ""}},
      {.title = absl::StrFormat("%s: %d corners, seen in %.0f %% of the image's %d cells", view,
                                coverage.corners().size(), 100 * coverage.Share(),
                                Coverage::kColumns * Coverage::kRows),
       .columns = 1,
       .legend = {}});
}

Picture PictureOfResiduals(const std::string& view, PixelSize image, double rms,
                           const std::vector<LensResidual>& residuals, const std::string& caption) {
  const double scale = 1.0 * kLeastWidth / image.width;
  const double longer = kTypicalResidual / scale / std::max(1e-6, std::sqrt(2.0) * rms);
  Picture picture = FieldsOf(image, residuals, scale);
  for (const bool outliers : {false, true}) {
    const Colour colour = outliers ? palette::kObstacle : palette::kRobot;
    for (const LensResidual& r : residuals) {
      if (r.outlier != outliers || !r.residual.allFinite()) continue;
      const Eigen::Vector2d line = longer * r.residual;
      const Eigen::Vector2d to = r.seen + line * std::min(1.0, 120 / scale / line.norm());
      cv::line(picture, Fine(r.seen, scale), Fine(to, scale), BgrOf(colour), outliers ? 2 : 1,
               cv::LINE_AA, kFraction);
      DrawDot(picture, Fine(r.seen, scale), outliers ? 3 : 1, colour);
    }
  }
  const double bar = RoundBelow(120 / (scale * longer));
  const int y = picture.rows - 20;
  cv::line(picture, {20, y}, {20 + cvRound(bar * longer * scale), y}, BgrOf(palette::kInk), 2);
  DrawText(picture, absl::StrFormat("%g px", bar), {20, y - 12}, {.height = 14});
  return ContactSheet(
      {{picture, caption}},
      {.title = absl::StrFormat("%s: residuals, %.0f times as long", view, longer),
       .columns = 1,
       .legend = {{palette::kRobot, "corner: from where it was seen to where it should be"},
                  {palette::kObstacle, "left out"},
                  {Colour{200, 200, 200}, "corners seen: many"},
                  {Colour{240, 240, 240}, "few"},
                  {palette::kPaper, "none"}}});
}

Picture PictureOfLensMap(const SolvedCamera& camera) {
  const LensMap& map = camera.map;
  const double scale = 1.0 * kLeastWidth / camera.width;
  cv::Mat1f sigmas(map.rows, map.columns);
  for (size_t i = 0; i < map.sigmas.size(); ++i) {
    sigmas(static_cast<int>(i) / map.columns, static_cast<int>(i) % map.columns) =
        static_cast<float>(std::min(map.sigmas[i] / map.limit, 9.0));
  }
  Picture picture = BlankFor({camera.width, camera.height}, scale, palette::kPaper);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const cv::Point2f at(static_cast<float>(x) * static_cast<float>(map.columns - 1) /
                               static_cast<float>(picture.cols),
                           static_cast<float>(y) * static_cast<float>(map.rows - 1) /
                               static_cast<float>(picture.rows));
      cv::Mat1f value;
      cv::getRectSubPix(sigmas, {1, 1}, at, value);
      const double share = value(0, 0);
      const auto shade = static_cast<uint8_t>(cvRound(255 - 120 * std::min(1.0, share)));
      picture.at<cv::Vec3b>(y, x) =
          share <= 1 ? cv::Vec3b(shade, shade, shade) : cv::Vec3b(130, 130, 230);
    }
  }
  for (int row = 0; row < map.rows; row += 3) {
    for (int column = 0; column < map.columns; column += 4) {
      const double sigma = map.sigmas[static_cast<size_t>(row * map.columns + column)];
      const cv::Point at(std::min(picture.cols - 50, column * picture.cols / (map.columns - 1)),
                         std::clamp(row * picture.rows / (map.rows - 1), 16, picture.rows - 6));
      DrawText(picture, std::isfinite(sigma) ? absl::StrFormat("%.2f", sigma) : "-", at,
               {.height = 13});
    }
  }
  return ContactSheet(
      {{picture, absl::StrFormat("known to %.2g px in %.0f %% of the image; numbers: px at the "
                                 "boards' distance, %.2f m",
                                 map.limit, 100 * map.KnownShare(), camera.distance)}},
      {.title = absl::StrFormat("%s: where the lens is known", camera.name),
       .columns = 1,
       .legend = {{palette::kPaper, "known exactly"},
                  {Colour{135, 135, 135}, absl::StrFormat("known to %.2g px", map.limit)},
                  {Colour{230, 130, 130}, "known less"}}});
}

Picture PaintDrift(const ViewDrift& drift, const ViewSizes& sizes, double limit_mask) {
  const double scale = static_cast<double>(kSide) / std::max(sizes.image.width, sizes.image.height);
  Picture picture = BlankFor(sizes.image, scale, palette::kBackground);
  double longest = 0;
  for (size_t i = 0; i < drift.before.size(); ++i) {
    longest = std::max(longest, (drift.after[i] - drift.before[i]).norm());
  }
  const double longer =
      longest > 0 ? std::min(kMostLonger, std::floor(kLongest / (scale * longest)) + 1) : 1;
  const bool moved = drift.moved_mask > limit_mask;
  for (size_t i = 0; i < drift.before.size(); ++i) {
    const Eigen::Vector2d& from = drift.before[i];
    const cv::Point begin = Fine(from, scale);
    cv::arrowedLine(picture, begin, Fine(from + longer * (drift.after[i] - from), scale),
                    BgrOf(moved ? palette::kObstacle : palette::kRobot), 2, cv::LINE_AA, kFraction,
                    0.2);
    DrawDot(picture, begin, 2, palette::kInk);
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
