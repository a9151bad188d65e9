// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/reference.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// As many images' worth of trust has the noise that is typical of the whole image.
constexpr double kTypicalNoiseWeight = 8;
// A pixel's noise is at least its largest deviation over this.
constexpr double kJump = 4;
constexpr double kReferenceUnsteady = 4;  // times the typical noise

// The variance of which most pixels' sample variances, of `degrees` degrees of freedom, are
// samples.
double TypicalVariance(const cv::Mat& variances, double degrees) {
  const cv::Mat variance = variances.reshape(1);
  std::vector<float> sorted(variance.begin<float>(), variance.end<float>());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  // Median of the chi-squared distribution, as Wilson and Hilferty approximate it.
  return *middle / std::pow(1 - 2 / (9 * degrees), 3);
}

std::string EncodePng(const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  if (!cv::imencode(".png", image, bytes)) {
    throw std::runtime_error("a reference image cannot be encoded as PNG");
  }
  return {bytes.begin(), bytes.end()};
}

absl::StatusOr<cv::Mat> DecodePng(const std::string& png, const std::string& name) {
  if (!png.empty()) {
    const cv::Mat bytes(1, static_cast<int>(png.size()), CV_8UC1, const_cast<char*>(png.data()));
    try {
      cv::Mat image = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
      if ((image.type() == CV_16UC1 || image.type() == CV_16UC3) && !image.empty()) return image;
    } catch (const cv::Exception&) {
      // Reported below.
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the reference's ", name, " is not a 16-bit PNG image"));
}

void CheckImage(const cv::Mat& image) {
  if (image.empty()) throw std::invalid_argument("the camera image is empty");
  if (image.type() != CV_8UC1 && image.type() != CV_8UC3) {
    throw std::invalid_argument(
        "a camera image has 8 bits per channel, and one channel (grey) or three (blue, green, "
        "red)");
  }
}

// 255 where all channels of the noise are undefined; empty if that is nowhere.
cv::Mat UndefinedPixels(const cv::Mat& noise) {
  cv::Mat undefined;
  cv::Mat first;
  cv::extractChannel(noise, first, 0);
  cv::compare(first, int{Reference::kUndefined}, undefined, cv::CMP_EQ);
  return cv::countNonZero(undefined) > 0 ? undefined : cv::Mat();
}

// Of some thousand values that are spread over the image.
int MedianNoise(const cv::Mat& noise) {
  const cv::Mat values = noise.reshape(1);
  const int step =
      std::max(1, static_cast<int>(std::sqrt(static_cast<double>(values.total()) / 4000)));
  std::vector<uint16_t> sorted;
  for (int y = step / 2; y < values.rows; y += step) {
    for (int x = step / 2; x < values.cols; x += step) {
      const uint16_t value = values.at<uint16_t>(y, x);
      if (value != Reference::kUndefined) sorted.push_back(value);
    }
  }
  if (sorted.empty()) return 0;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

}  // namespace

cv::Mat Grey(const cv::Mat& image) {
  CheckImage(image);
  if (image.channels() == 1) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

Reference::Reference(cv::Mat mean, cv::Mat noise)
    : mean_(std::move(mean)),
      noise_(std::move(noise)),
      undefined_(UndefinedPixels(noise_)),
      typical_noise_(MedianNoise(noise_)) {}

Reference Reference::FromImages(std::span<const cv::Mat> images) {
  if (images.size() < 2) {
    throw std::invalid_argument("a reference needs at least two images: its noise is measured");
  }
  const cv::Size size = images.front().size();
  const int channels = images.front().channels();
  CheckImage(images.front());
  cv::Mat sum = cv::Mat::zeros(size, CV_64FC(channels));
  cv::Mat sum_of_squares = sum.clone();
  cv::Mat least = images.front().clone();
  cv::Mat greatest = images.front().clone();
  for (const cv::Mat& image : images) {
    CheckImage(image);
    if (image.size() != size || image.channels() != channels) {
      throw std::invalid_argument(
          absl::StrCat("the images of a reference differ in size or colour: ", size.width, " x ",
                       size.height, ", channels ", channels, ", and ", image.cols, " x ",
                       image.rows, ", channels ", image.channels()));
    }
    cv::accumulate(image, sum);
    cv::accumulateSquare(image, sum_of_squares);
    cv::min(least, image, least);
    cv::max(greatest, image, greatest);
  }
  const auto count = static_cast<double>(images.size());
  const cv::Mat squares = sum_of_squares - sum.mul(sum, 1 / count);
  cv::Mat variance;
  squares.convertTo(variance, CV_32F, 1 / (count - 1));
  variance = cv::max(variance, 0);
  const double typical = TypicalVariance(variance, count - 1);
  // An image differs from the mean by its own noise, and by what is left of it in the mean.
  const double wide = (1 + 1 / count) / (count - 1 + kTypicalNoiseWeight);
  variance.convertTo(variance, CV_32F, wide * (count - 1), wide * kTypicalNoiseWeight * typical);
  cv::Mat deviation;
  cv::sqrt(variance, deviation);
  cv::Mat middle;
  sum.convertTo(middle, CV_32F, 1 / count);
  cv::Mat above;
  cv::Mat below;
  cv::subtract(greatest, middle, above, cv::noArray(), CV_32F);
  cv::subtract(middle, least, below, cv::noArray(), CV_32F);
  const cv::Mat jump = cv::max(above, below) / kJump;
  deviation = cv::max(deviation, jump);

  cv::Mat mean;
  cv::Mat noise;
  sum.convertTo(mean, CV_16U, kGreyLevel / count);
  deviation.convertTo(noise, CV_16U, kGreyLevel);
  return Reference(std::move(mean), std::move(noise));
}

absl::StatusOr<Reference> Reference::FromPng(const std::string& mean_png,
                                             const std::string& noise_png) {
  ASSIGN_OR_RETURN(cv::Mat mean, DecodePng(mean_png, "mean"));
  ASSIGN_OR_RETURN(cv::Mat noise, DecodePng(noise_png, "noise"));
  if (mean.size() != noise.size() || mean.channels() != noise.channels()) {
    return absl::InvalidArgumentError("the reference's mean and noise differ in size or channels");
  }
  return Reference(std::move(mean), std::move(noise));
}

Reference::Figures Reference::Describe() const {
  std::vector<uint16_t> sorted;
  Figures figures;
  const int channels = this->channels();
  for (int y = 0; y < noise_.rows; ++y) {
    const auto* noise = noise_.ptr<uint16_t>(y);
    for (int x = 0; x < noise_.cols * channels; ++x) {
      if (noise[x] != kUndefined) sorted.push_back(noise[x]);
    }
  }
  figures.undefined = undefined_.empty() ? 0 : cv::countNonZero(undefined_);
  if (sorted.empty()) return figures;
  double sum = 0;
  for (const uint16_t noise : sorted) sum += noise;
  figures.mean_noise = sum / kGreyLevel / static_cast<double>(sorted.size());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double unsteady = kReferenceUnsteady * std::max<double>(*middle, kGreyLevel / 4.0);
  for (int y = 0; y < noise_.rows; ++y) {
    const auto* noise = noise_.ptr<uint16_t>(y);
    const auto* mean = mean_.ptr<uint16_t>(y);
    for (int x = 0; x < noise_.cols * channels; x += channels) {
      if (noise[x] == kUndefined) continue;
      figures.unsteady += *std::max_element(noise + x, noise + x + channels) > unsteady ? 1 : 0;
      const bool saturated =
          *std::max_element(mean + x, mean + x + channels) >= kSaturated * kGreyLevel;
      figures.saturated += saturated ? 1 : 0;
    }
  }
  return figures;
}

Reference Reference::AsGrey() const {
  if (channels() == 1) return *this;
  const cv::Matx13f weights(0.114F, 0.587F, 0.299F);
  cv::Mat mean;
  cv::transform(mean_, mean, weights);
  // As if the channels were noisy each on its own; less noise than that would be too sure.
  cv::Mat real;
  noise_.convertTo(real, CV_32F);
  cv::Mat variance;
  cv::transform(real.mul(real), variance,
                cv::Matx13f(0.114F * 0.114F, 0.587F * 0.587F, 0.299F * 0.299F));
  cv::sqrt(variance, variance);
  cv::Mat noise;
  variance.convertTo(noise, CV_16U);
  if (!undefined_.empty()) noise.setTo(cv::Scalar(kUndefined), undefined_);
  return Reference(std::move(mean), std::move(noise));
}

std::string Reference::MeanPng() const { return EncodePng(mean_); }
std::string Reference::NoisePng() const { return EncodePng(noise_); }

namespace {

// Values that differ from the median by more grey levels than that, and than this many times the
// typical deviation of the pixel's values, are something else than the cell.
constexpr double kNear = 6;
constexpr double kNearDeviations = 4;
constexpr double kReferenceWithRobotEnough =
    0.6;                                     // share of the values that must be near the median
constexpr double kTypicalWeight = 8;         // as many images' worth of trust has the typical noise
constexpr double kNormalDeviation = 1.4826;  // times the median deviation

double MedianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// What a value of a pixel is when the robot is not there. There are tens of millions of them.
struct Seen {
  float mean = 0;
  float squares = 0;  // of the deviations from the mean
  int count = 0;      // 0: not known
};

Seen SeenOf(std::vector<float>& values) {
  if (values.size() < static_cast<size_t>(Reference::kFewestUncovered)) return {};
  const double enough = std::max<double>(
      Reference::kFewestUncovered, kReferenceWithRobotEnough * static_cast<double>(values.size()));
  const double median = MedianOf(values);
  std::vector<float> deviations;
  for (const double value : values) {
    deviations.push_back(static_cast<float>(std::abs(value - median)));
  }
  const double near = std::max(kNear, kNearDeviations * kNormalDeviation * MedianOf(deviations));
  std::erase_if(values, [&](double value) { return std::abs(value - median) > near; });
  const auto count = static_cast<double>(values.size());
  if (count < enough) return {};
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  double squares = 0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  return {.mean = static_cast<float>(mean),
          .squares = static_cast<float>(squares),
          .count = static_cast<int>(values.size())};
}

void Check(std::span<const cv::Mat> images, std::span<const cv::Mat> covered) {
  if (images.size() < static_cast<size_t>(Reference::kFewestUncovered)) {
    throw std::invalid_argument("a reference with the robot in it needs at least five images");
  }
  if (covered.size() != images.size()) {
    throw std::invalid_argument("every image needs a mask of where the robot is, or an empty one");
  }
  for (size_t i = 0; i < images.size(); ++i) {
    Grey(images[i]);  // throws if it is no camera image
    if (images[i].size() != images[0].size() || images[i].type() != images[0].type()) {
      throw std::invalid_argument("the images of a reference differ in size or colour");
    }
    if (!covered[i].empty() &&
        (covered[i].size() != images[0].size() || covered[i].type() != CV_8UC1)) {
      throw std::invalid_argument(
          "the mask of where the robot is must be an 8-bit image of the same size");
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
  std::vector<float> variances;
  std::vector<float> values;
  // Growing, they would take three times as much.
  seen.reserve(images[0].total() * static_cast<size_t>(channels));
  variances.reserve(seen.capacity());
  for (int y = 0; y < size.height; ++y) {
    for (int i = 0; i < size.width * channels; ++i) {
      values.clear();
      for (size_t k = 0; k < images.size(); ++k) {
        if (!covered[k].empty() && covered[k].ptr<uint8_t>(y)[i / channels] != 0) continue;
        values.push_back(images[k].ptr<uint8_t>(y)[i]);
      }
      const Seen value = SeenOf(values);
      seen.push_back(value);
      if (value.count > 0) variances.push_back(value.squares / static_cast<float>(value.count - 1));
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
      if (!std::all_of(pixel.begin(), pixel.end(),
                       [](const Seen& value) { return value.count > 0; })) {
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
