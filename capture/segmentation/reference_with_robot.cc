// The artificial reference: what is seen where the robot happens not to be.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "capture/segmentation/reference.h"

namespace silhouette {
namespace {

// Values that differ from the median by more grey levels than that, and than so many times the
// typical deviation of the pixel's values, are something else than the cell.
constexpr double kNear = 6;
constexpr double kNearDeviations = 4;
constexpr double kReferenceWithRobotEnough =
    0.6;                                     // share of the values that must be near the median
constexpr double kTypicalWeight = 8;         // as many images' worth of trust has the typical noise
constexpr double kNormalDeviation = 1.4826;  // times the median deviation

double MedianOf(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// What a value of a pixel is when the robot is not there.
struct Seen {
  bool known = false;
  double mean = 0;
  double squares = 0;  // of the deviations from the mean
  double count = 0;
};

Seen SeenOf(std::vector<double>& values) {
  if (values.size() < static_cast<size_t>(Reference::kFewestUncovered)) return {};
  const double median = MedianOf(values);
  std::vector<double> deviations;
  for (const double value : values) deviations.push_back(std::abs(value - median));
  const double near = std::max(kNear, kNearDeviations * kNormalDeviation * MedianOf(deviations));
  Seen seen;
  for (const double value : values) {
    if (std::abs(value - median) > near) continue;
    seen.mean += value;
    ++seen.count;
  }
  seen.mean /= seen.count;
  for (const double value : values) {
    if (std::abs(value - median) <= near) seen.squares += (value - seen.mean) * (value - seen.mean);
  }
  seen.known = seen.count >= Reference::kFewestUncovered &&
               seen.count >= kReferenceWithRobotEnough * static_cast<double>(values.size());
  return seen;
}

void Check(std::span<const cv::Mat> images, std::span<const cv::Mat> covered) {
  if (images.size() < static_cast<size_t>(Reference::kFewestUncovered)) {
    throw std::invalid_argument("a reference with the robot in it needs at least five images");
  }
  if (covered.size() != images.size()) {
    throw std::invalid_argument("every image needs to be told where the robot is, or an empty one");
  }
  for (size_t i = 0; i < images.size(); ++i) {
    Grey(images[i]);  // throws if it is no camera image
    if (images[i].size() != images[0].size() || images[i].type() != images[0].type()) {
      throw std::invalid_argument("the images of a reference differ in size or colour");
    }
    if (!covered[i].empty() &&
        (covered[i].size() != images[0].size() || covered[i].type() != CV_8UC1)) {
      throw std::invalid_argument("where the robot is must be told as an 8-bit image of the size");
    }
  }
}

}  // namespace

Reference Reference::FromImagesWithRobot(std::span<const cv::Mat> images,
                                         std::span<const cv::Mat> covered) {
  Check(images, covered);
  const cv::Size size = images[0].size();
  const int channels = images[0].channels();
  std::vector<Seen> seen;
  std::vector<double> variances;
  std::vector<double> values;
  for (int y = 0; y < size.height; ++y) {
    for (int i = 0; i < size.width * channels; ++i) {
      values.clear();
      for (size_t k = 0; k < images.size(); ++k) {
        if (!covered[k].empty() && covered[k].ptr<uint8_t>(y)[i / channels] != 0) continue;
        values.push_back(images[k].ptr<uint8_t>(y)[i]);
      }
      seen.push_back(SeenOf(values));
      if (seen.back().known) variances.push_back(seen.back().squares / (seen.back().count - 1));
    }
  }
  const double typical = variances.empty() ? 1 : MedianOf(variances);
  cv::Mat mean(size, CV_16UC(channels), cv::Scalar::all(0));
  cv::Mat noise(size, CV_16UC(channels), cv::Scalar::all(kUndefined));
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const size_t first =
          (static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x)) *
          static_cast<size_t>(channels);
      const std::span pixel(&seen[first], static_cast<size_t>(channels));
      if (!std::all_of(pixel.begin(), pixel.end(), [](const Seen& value) { return value.known; })) {
        continue;
      }
      for (int c = 0; c < channels; ++c) {
        const Seen& value = pixel[static_cast<size_t>(c)];
        const double variance =
            (value.squares + kTypicalWeight * typical) / (value.count - 1 + kTypicalWeight);
        mean.ptr<uint16_t>(y)[x * channels + c] =
            static_cast<uint16_t>(std::lround(value.mean * kGreyLevel));
        noise.ptr<uint16_t>(y)[x * channels + c] = static_cast<uint16_t>(
            std::clamp<long>(std::lround(std::sqrt(variance) * kGreyLevel), 0, kUndefined - 1));
      }
    }
  }
  return Reference(std::move(mean), std::move(noise));
}

}  // namespace silhouette
