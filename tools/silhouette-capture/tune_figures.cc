#include "tools/silhouette-capture/tune_figures.h"

#include <opencv2/imgproc.hpp>

#include "capture/segmentation/down_sampling.h"

namespace silhouette {
namespace {

constexpr double kNearlyFound = 0.7;
constexpr double kHardlyFound = 1.4;

int64_t CountOf(const cv::Mat& set) { return cv::countNonZero(set); }

// How many pixels are in `a` and not in `b`.
int64_t OnlyIn(const Mask& a, const Mask& b) {
  int64_t count = 0;
  for (int y = 0; y < a.height(); ++y) {
    for (int x = 0; x < a.width(); ++x) count += a.at(x, y) && !b.at(x, y) ? 1 : 0;
  }
  return count;
}

}  // namespace

void TuneFigures::Add(const TuneFigures& other) {
  for (int64_t TuneFigures::*part :
       {&TuneFigures::pixels, &TuneFigures::foreground, &TuneFigures::areas, &TuneFigures::specks,
        &TuneFigures::close, &TuneFigures::gained, &TuneFigures::lost, &TuneFigures::empty_pixels,
        &TuneFigures::false_pixels, &TuneFigures::mask_pixels, &TuneFigures::mask_gained,
        &TuneFigures::mask_lost, &TuneFigures::recorded, &TuneFigures::recorded_added,
        &TuneFigures::recorded_removed}) {
    this->*part += other.*part;
  }
}

TunedImage Tune(const TuneImage& image, const std::vector<TuneVariant>& variants,
                MaskSize mask_size) {
  TunedImage tuned;
  std::vector<Mask> masks;
  for (const TuneVariant& variant : variants) {
    const ForegroundSteps steps =
        StepsToForeground(image.image, *image.reference, variant.settings);
    tuned.steps.push_back(steps);
    masks.push_back(DownSample(steps.foreground, mask_size, variant.settings.min_cover));
    const cv::Mat& first = tuned.steps.front().foreground;
    TuneFigures figures;
    figures.pixels = static_cast<int64_t>(steps.foreground.total());
    figures.foreground = CountOf(steps.foreground);
    cv::Mat labels;
    figures.areas = cv::connectedComponents(steps.foreground, labels, 8) - 1;
    figures.specks = CountOf(steps.no_shadow & ~steps.foreground);
    figures.close = CountOf((steps.over_limit > kNearlyFound) & (steps.over_limit <= kHardlyFound));
    figures.gained = CountOf(steps.foreground & ~first);
    figures.lost = CountOf(first & ~steps.foreground);
    figures.empty_pixels = image.empty ? figures.pixels : 0;
    figures.false_pixels = image.empty ? figures.foreground : 0;
    figures.mask_pixels = static_cast<int64_t>(masks.back().Count());
    figures.mask_gained = OnlyIn(masks.back(), masks.front());
    figures.mask_lost = OnlyIn(masks.front(), masks.back());
    if (image.recorded && image.recorded->size() == mask_size) {
      figures.recorded = static_cast<int64_t>(image.recorded->Count());
      figures.recorded_added = OnlyIn(masks.back(), *image.recorded);
      figures.recorded_removed = OnlyIn(*image.recorded, masks.back());
    }
    tuned.figures.push_back(figures);
  }
  return tuned;
}

}  // namespace silhouette
