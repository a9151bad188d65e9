#include "capture/segmentation/reference.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

// As many images' worth of trust has the noise that is typical of the whole image.
constexpr double kTypicalNoiseWeight = 8;

// The variance of which most pixels' sample variances, of `degrees` degrees of freedom, are
// samples.
double TypicalVariance(const cv::Mat& variance, double degrees) {
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
      if (image.type() == CV_16UC1 && !image.empty()) return image;
    } catch (const cv::Exception&) {
      // Told below.
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the reference's ", name, " is not a 16-bit grey PNG image"));
}

}  // namespace

cv::Mat Grey(const cv::Mat& image) {
  if (image.empty()) throw std::invalid_argument("the camera image is empty");
  if (image.type() == CV_8UC1) return image;
  if (image.type() != CV_8UC3) {
    throw std::invalid_argument(
        "a camera image has 8 bits per channel, and one channel (grey) or three (blue, green, "
        "red)");
  }
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

Reference::Reference(cv::Mat mean, cv::Mat noise)
    : mean_(std::move(mean)), noise_(std::move(noise)) {}

Reference Reference::FromImages(std::span<const cv::Mat> images) {
  if (images.size() < 2) {
    throw std::invalid_argument("a reference needs at least two images: its noise is measured");
  }
  const cv::Size size = images.front().size();
  cv::Mat sum = cv::Mat::zeros(size, CV_64FC1);
  cv::Mat sum_of_squares = cv::Mat::zeros(size, CV_64FC1);
  for (const cv::Mat& image : images) {
    const cv::Mat grey = Grey(image);
    if (grey.size() != size) {
      throw std::invalid_argument(
          absl::StrCat("the images of a reference differ in size: ", size.width, " x ", size.height,
                       " and ", grey.cols, " x ", grey.rows));
    }
    cv::accumulate(grey, sum);
    cv::accumulateSquare(grey, sum_of_squares);
  }
  const auto count = static_cast<double>(images.size());
  const cv::Mat squares = sum_of_squares - sum.mul(sum, 1 / count);
  cv::Mat variance;
  squares.convertTo(variance, CV_32F, 1 / (count - 1));
  variance = cv::max(variance, 0);
  const double typical = TypicalVariance(variance, count - 1);
  variance =
      (variance * (count - 1) + kTypicalNoiseWeight * typical) / (count - 1 + kTypicalNoiseWeight);
  cv::Mat deviation;
  cv::sqrt(variance, deviation);

  cv::Mat mean;
  cv::Mat noise;
  sum.convertTo(mean, CV_16U, kGreyLevel / count);
  deviation.convertTo(noise, CV_16U, kGreyLevel);
  return Reference(std::move(mean), std::move(noise));
}

absl::StatusOr<Reference> Reference::FromPng(const std::string& mean_png,
                                             const std::string& noise_png) {
  absl::StatusOr<cv::Mat> mean = DecodePng(mean_png, "mean");
  if (!mean.ok()) return mean.status();
  absl::StatusOr<cv::Mat> noise = DecodePng(noise_png, "noise");
  if (!noise.ok()) return noise.status();
  if (mean->size() != noise->size()) {
    return absl::InvalidArgumentError("the reference's mean and noise differ in size");
  }
  return Reference(*std::move(mean), *std::move(noise));
}

std::string Reference::MeanPng() const { return EncodePng(mean_); }
std::string Reference::NoisePng() const { return EncodePng(noise_); }

}  // namespace silhouette
