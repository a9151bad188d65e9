#include "tools/silhouette-calibrate/band_pictures.h"

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
#include "server/collision/epipolar_bands.h"

namespace silhouette {
namespace {

constexpr int kTileSide = 560;  // about, in pixels
constexpr std::array<Colour, 5> kColours = {palette::kObstacle, palette::kRobot, palette::kStart,
                                            palette::kGoal, palette::kTight};

// A pixel that is shown: where it is, and where the other view saw the same.
struct Shown {
  Eigen::Vector2d here = Eigen::Vector2d::Zero();  // pixels of the camera images
  std::optional<Eigen::Vector2d> there;
};

MaskSize BandPicturesSizeOf(const PairedView& view) {
  return {view.sizes.mask.width, view.sizes.mask.height};
}

int MaskPixelOf(const PairedView& view, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d scaled = ScaledTo(pixel, view.sizes.image, view.sizes.mask);
  const MaskSize size = BandPicturesSizeOf(view);
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

class Tile {
 public:
  Tile(const BandPictures& pictures, int view) : view_(pictures.views[static_cast<size_t>(view)]) {
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
    cv::circle(picture_, centre, 11,
               {double(colour.blue), double(colour.green), double(colour.red)}, 2, cv::LINE_AA);
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
  Tile pixels(pictures, here);
  Tile across(pictures, there);
  int held = 0;
  int marked = 0;
  for (size_t i = 0; i < shown.size(); ++i) {
    const int pixel = MaskPixelOf(view, shown[i].here);
    const MaskSize size = BandPicturesSizeOf(other);
    pixels.Veil(Mask::FromPredicate(
                    BandPicturesSizeOf(view),
                    [&](int x, int y) { return y * BandPicturesSizeOf(view).width + x == pixel; }),
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

}  // namespace

Picture PaintBands(const BandPictures& pictures, int a, int b) {
  std::vector<MaskSize> sizes;
  for (const PairedView& view : pictures.views) sizes.push_back(BandPicturesSizeOf(view));
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

}  // namespace silhouette
