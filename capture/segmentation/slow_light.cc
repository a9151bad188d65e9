// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/slow_light.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

#include "capture/segmentation/brightness.h"

namespace silhouette {
namespace {

constexpr int kTiles = SlowLight::kColumns * SlowLight::kRows;
constexpr int kStride = 3;                // every n-th pixel is used, along both axes
constexpr double kSlowLightEnough = 0.2;  // share of a tile's pixels that its factor needs
constexpr int kFewestTiles = 8;           // that tell how the light changes elsewhere
// A single image's noise moves a factor as little as the time since the one before is shorter than
// that.
constexpr double kSmoothingSeconds = 20;
constexpr uint16_t kSlowLightDarkest = 12 * Reference::kGreyLevel;
constexpr uint16_t kSlowLightBrightest = 240 * Reference::kGreyLevel;

// A place along one axis, on the line through the middles of two neighbouring tiles; beyond the
// outermost middles the lines go on.
struct Between {
  int lower = 0;
  double share = 0;  // of the way to the next
};

Between PlaceOf(double pixel, int pixels, int tiles) {
  const double place = (pixel + 0.5) * tiles / pixels - 0.5;
  const int lower = std::clamp(static_cast<int>(std::floor(place)), 0, tiles - 2);
  return {.lower = lower, .share = place - lower};
}

// The plane a + b * column + c * row of least squares through values of tiles.
class Plane {
 public:
  explicit Plane(const std::vector<std::optional<double>>& values) {
    cv::Matx33d normal = cv::Matx33d::zeros();
    cv::Vec3d right(0, 0, 0);
    for (int tile = 0; tile < kTiles; ++tile) {
      if (!values[static_cast<size_t>(tile)]) continue;
      const cv::Vec3d at = Terms(tile);
      normal += at * at.t();
      right += at * *values[static_cast<size_t>(tile)];
      ++tiles_;
    }
    known_ = tiles_ >= kFewestTiles && cv::solve(normal, right, plane_, cv::DECOMP_CHOLESKY);
  }

  bool known() const { return known_; }
  double At(int tile) const { return Terms(tile).dot(plane_); }

 private:
  static cv::Vec3d Terms(int tile) {
    return {1, static_cast<double>(tile % SlowLight::kColumns),
            static_cast<double>(tile / SlowLight::kColumns)};
  }

  cv::Vec3d plane_;
  int tiles_ = 0;
  bool known_ = false;
};

// By how much every tile is brighter than `brightness` says; nothing where too little is seen.
std::vector<std::optional<double>> FactorsSeen(const cv::Mat& image, const Reference& reference,
                                               const cv::Mat& covered,
                                               const Brightness& brightness) {
  std::vector<std::vector<double>> ratios(kTiles);
  std::vector<int> looked_at(kTiles);
  const int channels = image.channels();
  for (int y = 0; y < image.rows; y += kStride) {
    const int row = y * SlowLight::kRows / image.rows;
    const auto* levels = image.ptr<uint8_t>(y);
    const auto* mean = reference.mean().ptr<uint16_t>(y);
    const auto* noise = reference.noise().ptr<uint16_t>(y);
    const auto* hidden = covered.ptr<uint8_t>(y);
    for (int x = 0; x < image.cols; x += kStride) {
      const auto tile =
          static_cast<size_t>(row * SlowLight::kColumns + x * SlowLight::kColumns / image.cols);
      ++looked_at[tile];
      if (hidden[x] != 0) continue;
      const int i = x * channels + x / kStride % channels;
      if (mean[i] < kSlowLightDarkest || mean[i] > kSlowLightBrightest ||
          noise[i] == Reference::kUndefined || levels[i] >= Reference::kSaturated) {
        continue;
      }
      ratios[tile].push_back((levels[i] - brightness.offset) * Reference::kGreyLevel /
                             (brightness.gain * mean[i]));
    }
  }
  std::vector<std::optional<double>> factors(kTiles);
  for (size_t tile = 0; tile < kTiles; ++tile) {
    std::vector<double>& seen = ratios[tile];
    if (static_cast<double>(seen.size()) < kSlowLightEnough * looked_at[tile] || seen.size() < 10)
      continue;
    const auto middle = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 2);
    std::nth_element(seen.begin(), middle, seen.end());
    factors[tile] = *middle;
  }
  return factors;
}

// The foreground with what is near it.
cv::Mat SlowLightCovered(const cv::Mat& foreground) {
  const int reach =
      std::min(foreground.cols / SlowLight::kColumns, foreground.rows / SlowLight::kRows) / 4;
  cv::Mat covered;
  cv::dilate(foreground, covered,
             cv::getStructuringElement(cv::MORPH_RECT, {2 * reach + 1, 2 * reach + 1}));
  return covered;
}

}  // namespace

double SlowLight::At(double x, double y, cv::Size size) const {
  if (none()) return 1;
  const Between column = PlaceOf(x, size.width, kColumns);
  const Between row = PlaceOf(y, size.height, kRows);
  const auto factor = [&](int r, int c) { return factors_[static_cast<size_t>(r * kColumns + c)]; };
  const auto along = [&](int r) {
    return factor(r, column.lower) +
           column.share * (factor(r, column.lower + 1) - factor(r, column.lower));
  };
  return along(row.lower) + row.share * (along(row.lower + 1) - along(row.lower));
}

void SlowLight::Row(int y, cv::Size size, std::span<float> factors) const {
  const double tile = static_cast<double>(size.width) / kColumns;
  const auto middle = [&](int column) { return (column + 0.5) * tile - 0.5; };
  int x = 0;
  for (int column = 0; column + 1 < kColumns; ++column) {
    const bool outermost = column + 2 == kColumns;
    const int end = outermost ? size.width : static_cast<int>(std::ceil(middle(column + 1)));
    const double first = At(middle(column), y, size);
    const double last = At(middle(column + 1), y, size);
    const auto step = static_cast<float>((last - first) / tile);
    const auto start = static_cast<float>(first - step * middle(column));
    for (; x < std::min(end, size.width); ++x) {
      factors[static_cast<size_t>(x)] = start + step * static_cast<float>(x);
    }
  }
}

SlowLight SlowLight::Learn(const cv::Mat& image, const Reference& reference,
                           const cv::Mat& foreground, double seconds) const {
  if (image.size() != reference.size() || image.channels() != reference.channels() ||
      foreground.size() != image.size() || foreground.type() != CV_8UC1) {
    throw std::invalid_argument("image, reference and foreground are not of one size and kind");
  }
  const Brightness brightness = BrightnessOf(image, reference, *this);
  std::vector<std::optional<double>> seen =
      FactorsSeen(image, reference, SlowLightCovered(foreground), brightness);
  const auto brightnesses =
      FactorsSeen(image, reference, cv::Mat::zeros(image.size(), CV_8UC1), brightness);
  cv::Mat hides;  // by tile: the share of it that is foreground, of 255
  cv::resize(foreground > 0, hides, {kColumns, kRows}, 0, 0, cv::INTER_AREA);
  SlowLight next;
  next.factors_ = none() ? std::vector<double>(kTiles, 1) : factors_;
  next.hidden_ = hidden_;
  next.hidden_.resize(kTiles);
  for (size_t tile = 0; tile < kTiles; ++tile) {
    if (!brightnesses[tile]) continue;
    const double now = *brightnesses[tile];
    std::optional<Hidden>& hidden = next.hidden_[tile];
    if (seen[tile] && (!hidden || now <= hidden->least - kLeft || now >= hidden->greatest + kLeft ||
                       std::abs(now - hidden->factor) <= kSame)) {
      hidden.reset();
      continue;
    }
    seen[tile].reset();
    if (!hidden && hides.data[tile] < 128) continue;  // most of it is the cell
    if (!hidden) hidden = Hidden{.least = now, .greatest = now, .factor = next.factors_[tile]};
    hidden->least = std::min(hidden->least, now);
    hidden->greatest = std::max(hidden->greatest, now);
  }
  const Plane plane(seen);
  std::vector<double> targets = next.factors_;
  for (int tile = 0; tile < kTiles; ++tile) {
    const auto i = static_cast<size_t>(tile);
    if (seen[i] || plane.known()) targets[i] = seen[i] ? *seen[i] : plane.At(tile);
  }
  // A factor of all tiles together is the whole image's brightness. Were it not taken out, noise
  // would carry it away with the time.
  const double all = std::accumulate(targets.begin(), targets.end(), 0.0) / kTiles;
  const double time = std::max(seconds, 0.0);
  const double most = kRate * time;
  const double weight = 1 - std::exp(-time / kSmoothingSeconds);
  for (size_t i = 0; i < targets.size(); ++i) {
    double& factor = next.factors_[i];
    factor += std::clamp(weight * (targets[i] / all - factor), -most, most);
    factor = std::clamp(factor, 1 - kMost, 1 + kMost);
  }
  return next;
}

}  // namespace silhouette
