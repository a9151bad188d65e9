// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/calibration_picture.h"

#include <algorithm>
#include <array>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

constexpr int kCalibrationPictureTileSide = 448;  // about, in pixels
constexpr Colour kOnceRobot{222, 225, 228};
constexpr Colour kRobotNow{112, 118, 124};
constexpr std::array<Colour, kMostPixels> kColours = {palette::kObstacle, palette::kRobot,
                                                      palette::kStart, palette::kGoal};

// The pixels of `other` that may show what `pixel` of `view` shows.
Mask BandOf(const EpipolarBands& bands, int view, MaskPixel pixel, int other) {
  const auto sizes = bands.mask_sizes();
  const MaskSize here = sizes[static_cast<size_t>(view)];
  const MaskSize there = sizes[static_cast<size_t>(other)];
  return Mask::FromPredicate(there, [&](int x, int y) {
    return bands.Meet(view, pixel.y * here.width + pixel.x, other, y * there.width + x);
  });
}

Picture CalibrationPictureTile(const BandsPicture& picture, int view) {
  const size_t i = static_cast<size_t>(view);
  const MaskSize size = picture.bands.mask_sizes()[i];
  const int factor = std::max(1, kCalibrationPictureTileSide / std::max(size.width, size.height));
  Picture tile = Enlarged(PictureOf(picture.union_of_all[i], kOnceRobot, palette::kPaper), factor);
  tile = WithVeil(tile, picture.robot[i], kRobotNow, 1);
  if (view != picture.view && !picture.bands.Known(picture.view, view)) return tile;
  for (size_t k = 0; k < picture.pixels.size(); ++k) {
    const MaskPixel pixel = picture.pixels[k];
    if (view == picture.view) {
      const Mask mark =
          Mask::FromPredicate(size, [&](int x, int y) { return x == pixel.x && y == pixel.y; });
      tile = WithVeil(tile, mark, kColours[k], 1);
    } else {
      tile = WithVeil(tile, BandOf(picture.bands, picture.view, pixel, view), kColours[k], 0.55);
    }
  }
  return tile;
}

std::string CaptionOf(const BandsPicture& picture, int view) {
  const std::string name = picture.database.cell().views(view).name();
  if (view == picture.view) return name + ": the pixels";
  if (!picture.bands.Known(picture.view, view)) return name + ": no lines";
  const size_t contradicting =
      ContradictingPixels(picture.robot, picture.bands, picture.view, view).Count();
  return absl::StrFormat("%s: their bands; %d robot pixels contradict", name, contradicting);
}

}  // namespace

std::vector<MaskPixel> PixelsToShow(const std::vector<Mask>& robot, const EpipolarBands& bands,
                                    int view) {
  const Mask& here = robot[static_cast<size_t>(view)];
  std::vector<MaskPixel> candidates;
  std::vector<MaskPixel> contradicting;
  Mask against(here.size());
  for (int other = 0; other < bands.views(); ++other) {
    if (other == view || !bands.Known(view, other)) continue;
    against = against | ContradictingPixels(robot, bands, view, other);
  }
  const Mask core = Core(here);  // pixels that the robot covers wholly, where there are any
  for (int y = 0; y < here.height(); ++y) {
    for (int x = 0; x < here.width(); ++x) {
      if (against.at(x, y)) contradicting.push_back({x, y});
      if (core.Empty() ? here.at(x, y) : core.at(x, y)) candidates.push_back({x, y});
    }
  }
  std::vector<MaskPixel> chosen;
  if (!contradicting.empty()) chosen.push_back(contradicting[contradicting.size() / 2]);
  // Always the one that is furthest from those chosen.
  const auto distance = [&](const MaskPixel& pixel) {
    int nearest = here.width() * here.width() + here.height() * here.height();
    for (const MaskPixel& other : chosen) {
      const int dx = pixel.x - other.x;
      const int dy = pixel.y - other.y;
      nearest = std::min(nearest, dx * dx + dy * dy);
    }
    return nearest;
  };
  while (chosen.size() < std::min(kMostPixels, candidates.size())) {
    chosen.push_back(*std::max_element(
        candidates.begin(), candidates.end(),
        [&](const MaskPixel& a, const MaskPixel& b) { return distance(a) < distance(b); }));
  }
  return chosen;
}

Picture Paint(const BandsPicture& picture) {
  std::vector<CaptionedPicture> tiles = {
      {CalibrationPictureTile(picture, picture.view), CaptionOf(picture, picture.view)}};
  for (int view = 0; view < picture.bands.views(); ++view) {
    if (view == picture.view) continue;
    tiles.push_back({CalibrationPictureTile(picture, view), CaptionOf(picture, view)});
  }
  std::vector<LegendEntry> legend;
  for (size_t k = 0; k < picture.pixels.size(); ++k) {
    legend.push_back(
        {kColours[k], absl::StrFormat("pixel (%d, %d)", picture.pixels[k].x, picture.pixels[k].y)});
  }
  legend.push_back({kRobotNow, "robot"});
  legend.push_back({kOnceRobot, "robot at another configuration"});
  return ContactSheet(
      tiles, {.title = absl::StrCat("Where the other views may show what pixels of ",
                                    picture.database.cell().views(picture.view).name(),
                                    " show: ", JointText(picture.database.grid(), picture.number)),
              .columns = picture.bands.views() <= 4 ? 2 : 0,
              .legend = legend});
}

}  // namespace silhouette
