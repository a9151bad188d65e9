// SPDX-License-Identifier: Apache-2.0
// From a camera image of 640 x 480 to a mask of 64 x 64, a robot and a person in the cell.
#include <benchmark/benchmark.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "capture/segmentation/brightness.h"
#include "capture/segmentation/difference.h"
#include "capture/segmentation/down_sampling.h"
#include "tests/benchmark/timing.h"
#include "tests/capture/segmentation/images.h"

namespace silhouette::benchmarks {
namespace {

// The same differences as whole images of floating-point numbers, with OpenCV's filters.
class FloatingDifference {
 public:
  FloatingDifference(const Reference& reference, const SegmentationSettings& settings)
      : reference_(reference), settings_(settings) {
    constexpr double kUnit = 1.0 / Reference::kGreyLevel;
    reference.mean().convertTo(mean_, CV_32F, kUnit);
    reference.noise().convertTo(noise_, CV_32F, kUnit);
  }

  cv::Mat Foreground(const cv::Mat& image) const {
    const cv::Mat brighter = mean_ * BrightnessOf(image, reference_).gain;
    const cv::Mat expected = cv::min(brighter, 255);
    cv::Mat difference;
    cv::subtract(image, expected, difference, cv::noArray(), CV_32F);
    const cv::Mat noisy = noise_ * settings_.noise_factor;
    const cv::Mat allowed = cv::max(noisy, settings_.min_difference);
    cv::Mat foreground = cv::abs(difference) > allowed;
    AddFaint(difference, foreground);
    const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3});
    cv::morphologyEx(foreground, foreground, cv::MORPH_OPEN, disc);
    cv::morphologyEx(foreground, foreground, cv::MORPH_CLOSE, disc);
    return WithoutSmallAreas(foreground);
  }

 private:
  void AddFaint(const cv::Mat& difference, cv::Mat& foreground) const {
    const int side = settings_.faint_side;
    const cv::Mat open = foreground == 0;
    const auto around = [&](const cv::Mat& values) {
      cv::Mat sum = cv::Mat::zeros(difference.size(), CV_32FC1);
      values.copyTo(sum, open);
      cv::boxFilter(sum, sum, CV_32F, {side, side}, {-1, -1}, false, cv::BORDER_CONSTANT);
      return sum;
    };
    const cv::Mat count = around(cv::Mat(difference.size(), CV_32FC1, cv::Scalar(1)));
    cv::Mat root;
    cv::sqrt(count, root);
    const cv::Mat noisy = around(noise_) * settings_.noise_factor / root;
    const cv::Mat allowed = cv::max(noisy, count * settings_.faint_difference);
    const cv::Mat variance = around(noise_.mul(noise_));
    const cv::Mat beyond = around(difference.mul(difference)) - variance;
    const cv::Mat uncertain = variance * (std::sqrt(2.0) * settings_.noise_factor) / root;
    const double texture = settings_.texture_difference * settings_.texture_difference;
    const cv::Mat enough = count > side * side / 2;
    foreground |= (cv::abs(around(difference)) > allowed) & enough;
    foreground |= (beyond > cv::max(uncertain, count * texture)) & enough;
  }

  cv::Mat WithoutSmallAreas(const cv::Mat& foreground) const {
    cv::Mat labels;
    cv::Mat stats;
    cv::Mat centroids;
    cv::connectedComponentsWithStats(foreground, labels, stats, centroids, 8, CV_32S);
    cv::Mat kept(foreground.size(), CV_8UC1);
    for (int y = 0; y < kept.rows; ++y) {
      for (int x = 0; x < kept.cols; ++x) {
        const int label = labels.at<int>(y, x);
        const bool keep =
            label > 0 && stats.at<int>(label, cv::CC_STAT_AREA) >= settings_.min_blob_pixels;
        kept.at<uint8_t>(y, x) = keep ? 255 : 0;
      }
    }
    return kept;
  }

  const Reference& reference_;
  const SegmentationSettings& settings_;
  cv::Mat mean_;
  cv::Mat noise_;
};

struct Views {
  std::vector<cv::Mat> images;
  Reference reference;
};

const Views& TheViews() {
  static const Views views = [] {
    std::mt19937_64 random(1);
    const cv::Mat cell = EmptyCell({640, 480});
    std::vector<cv::Mat> images;
    for (int i = 0; i < 4; ++i) {
      cv::Mat light = cell.clone();
      cv::rectangle(light, {100 + 60 * i, 100, 150, 250}, cv::Scalar(220), cv::FILLED);
      cv::circle(light, {450, 300}, 60 + 10 * i, cv::Scalar(20), cv::FILLED);
      images.push_back(Expose(light, 1.02, 1.5, random));
    }
    return Views{std::move(images), Reference::FromImages(ExposeSeries(cell, 20, 1.5, random))};
  }();
  return views;
}

void MaskOfImage(benchmark::State& state) {
  const Views& views = TheViews();
  const SegmentationSettings settings;
  MeasureScenes(state, views.images.size(), Caches::kSwept, [&](size_t i) {
    benchmark::DoNotOptimize(Difference(views.images[i], views.reference, settings, {64, 64}));
  });
}

void FloatingMaskOfImage(benchmark::State& state) {
  const Views& views = TheViews();
  const SegmentationSettings settings;
  const FloatingDifference difference(views.reference, settings);
  MeasureScenes(state, views.images.size(), Caches::kSwept, [&](size_t i) {
    benchmark::DoNotOptimize(DownSample(difference.Foreground(views.images[i]), {64, 64}, 0));
  });
}

BENCHMARK(MaskOfImage)->Name("mask_of_image")->UseManualTime();
BENCHMARK(FloatingMaskOfImage)->Name("floating_mask_of_image")->UseManualTime();

}  // namespace
}  // namespace silhouette::benchmarks
