#include "capture/segmentation/deviating_pixels.h"

#include <algorithm>
#include <vector>

#include "capture/segmentation/open_values.h"
#include "capture/segmentation/surroundings.h"

namespace silhouette {
namespace {

constexpr int kGainUnit = 32768;

// Where a channel deviates the pixel does, with all its channels.
void UniteChannels(std::vector<uint8_t>& deviates, int pixels, uint8_t* __restrict foreground) {
  uint8_t* __restrict values = deviates.data();
  for (int x = 0; x < pixels; ++x) {
    const auto any = static_cast<uint8_t>(values[3 * x] | values[3 * x + 1] | values[3 * x + 2]);
    values[3 * x] = values[3 * x + 1] = values[3 * x + 2] = any;
    foreground[x] = static_cast<uint8_t>(foreground[x] | any);
  }
}

// The gains of a row's values, in 32768ths.
class Gains {
 public:
  Gains(cv::Size size, int channels, double gain, const SlowLight& slow_light)
      : size_(size),
        channels_(channels),
        gain_(gain),
        slow_light_(slow_light),
        factors_(static_cast<size_t>(slow_light.none() ? 0 : size.width)),
        units_(static_cast<size_t>(size.width * channels), GainUnits(gain)) {}

  const uint16_t* Row(int y) {
    if (slow_light_.none()) return units_.data();
    slow_light_.Row(y, size_, factors_);
    const auto unit = static_cast<float>(gain_ * kGainUnit);
    for (float& factor : factors_) factor = std::min(factor * unit + 0.5F, 65535.0F);
    const auto step = static_cast<size_t>(channels_);
    for (size_t c = 0; c < step; ++c) {
      for (size_t x = 0; x < factors_.size(); ++x) {
        units_[x * step + c] = static_cast<uint16_t>(static_cast<int32_t>(factors_[x]));
      }
    }
    return units_.data();
  }

 private:
  const cv::Size size_;
  const int channels_;
  const double gain_;
  const SlowLight& slow_light_;
  std::vector<float> factors_;
  std::vector<uint16_t> units_;
};

}  // namespace

uint16_t GainUnits(double gain) {
  return static_cast<uint16_t>(std::clamp(gain * kGainUnit + 0.5, 0.0, 65535.0));
}

cv::Mat DeviatingPixels(const cv::Mat& image, const Reference& reference,
                        const Brightness& brightness, const SlowLight& slow_light,
                        const SegmentationSettings& settings) {
  const int channels = image.channels();
  const int values = image.cols * channels;
  const int side = settings.faint_side;
  const int reach = side / 2;
  const bool squares = settings.texture_difference > 0;
  const bool means = squares || settings.faint_difference > 0;
  const DeviationLimits limits = LimitsOf(settings, brightness, reference);
  Gains gains(image.size(), channels, brightness.gain, slow_light);
  cv::Mat foreground(image.size(), CV_8UC1, cv::Scalar(0));
  // Row y is y % (side + 1): those around a row, and the one that has just gone.
  std::vector<OpenRow> rows(static_cast<size_t>(side) + 1, OpenRow(static_cast<size_t>(values)));
  const auto row_of = [&](int y) { return &rows[static_cast<size_t>(y % (side + 1))]; };
  Surroundings surroundings(values, channels, reach, squares);
  std::vector<uint8_t> deviates(static_cast<size_t>(values));
  const auto mark = [&](int y) {
    auto* row = foreground.ptr<uint8_t>(y);
    if (channels == 3) return UniteChannels(deviates, image.cols, row);
    for (int x = 0; x < values; ++x) {
      row[x] = static_cast<uint8_t>(row[x] | deviates[static_cast<size_t>(x)]);
    }
  };
  // A row is judged by its surroundings as soon as the last row of these is there.
  for (int y = 0; y < image.rows + reach; ++y) {
    const bool comes = y < image.rows;
    if (comes) {
      OpenRow& row = *row_of(y);
      const auto* noise = reference.noise().ptr<uint16_t>(y);
      FindDifferences(image.ptr<uint8_t>(y), reference.mean().ptr<uint16_t>(y), gains.Row(y),
                      limits.offset, values, row.difference.data());
      JudgeValues(row.difference.data(), noise, limits, values, deviates.data());
      mark(y);
      if (means) KeepOpen(deviates.data(), noise, values, squares, limits.steady, row);
    }
    if (!means) continue;
    surroundings.Move(comes ? row_of(y) : nullptr, y >= side ? row_of(y - side) : nullptr);
    if (y >= reach && y - reach < image.rows) {
      surroundings.Judge(limits, deviates.data());
      mark(y - reach);
    }
  }
  return foreground;
}

}  // namespace silhouette
