// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/slow_light.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "capture/segmentation/difference.h"
#include "tests/capture/segmentation/images.h"
#include "tests/random.h"

namespace silhouette {
namespace {

const cv::Size kSize(160, 120);

// `light` as the sun makes it: brighter towards the right edge by `slope`, darker towards the left.
cv::Mat Sloped(const cv::Mat& light, double slope) {
  cv::Mat sloped = light.clone();
  for (int x = 0; x < light.cols; ++x)
    sloped.col(x) *= 1 + slope * (2.0 * x / (light.cols - 1) - 1);
  return sloped;
}

class SlowLightTest : public testing::Test {
 protected:
  // An hour with an image every half minute. `at(time)`, 0 to 1, is what the camera sees.
  template <typename LightAt>
  SlowLight LearnForAnHour(LightAt at) {
    SlowLight light;
    for (int i = 0; i <= 120; ++i) {
      const cv::Mat image = Expose(at(i / 120.0), 1, 1.5, random_);
      light = light.Learn(image, reference_, Foreground(image, reference_, {}, light), 30);
    }
    return light;
  }
  int ForegroundPixels(const cv::Mat& light, const SlowLight& slow_light) {
    return cv::countNonZero(Foreground(Expose(light, 1, 1.5, random_), reference_, {}, slow_light));
  }

  Random random_;
  const cv::Mat cell_ = EmptyCell(kSize);
  const Reference reference_ = Reference::FromImages(ExposeSeries(cell_, 20, 1.5, random_));
};

TEST_F(SlowLightTest, SomeoneStandingStillForAnHourStaysForeground) {
  const cv::Rect person(70, 30, 22, 75);
  // As far as a faint thing spreads.
  const int reach = SegmentationSettings{}.faint_side / 2;
  const cv::Rect reached(person.x - reach, person.y - reach, person.width + 2 * reach,
                         person.height + 2 * reach);
  const Reference in_that_light =
      Reference::FromImages(ExposeSeries(Sloped(cell_, 0.2), 20, 1.5, random_));
  for (const int level : {20, 88, 112, 230}) {  // two nearly as grey as the cell
    const auto with_person = [&](double time) {
      cv::Mat light = Sloped(cell_, 0.2 * time);
      cv::rectangle(light, person, cv::Scalar(level), cv::FILLED);
      return light;
    };
    const SlowLight light = LearnForAnHour(with_person);
    const cv::Mat image = Expose(with_person(1), 1, 1.5, random_);
    const cv::Mat last = Foreground(image, reference_, {}, light);
    // What is seen of the person with a reference that was made in this very light.
    const int all = cv::countNonZero(Foreground(image, in_that_light, {})(person));
    ASSERT_GT(all, 0.4 * person.area()) << level;
    EXPECT_GT(cv::countNonZero(last(person)), 0.95 * all) << level;
    // And the cell beside is background, though the light is another.
    cv::Mat beside = last.clone();
    beside(reached).setTo(0);
    EXPECT_LT(cv::countNonZero(beside), 200) << level;
    // As is nearly all of the cell when the person has gone: the light there changed as it did
    // around.
    EXPECT_LT(ForegroundPixels(Sloped(cell_, 0.2), light), 0.2 * person.area()) << level;
  }
}

// On a plain floor, beside which the light passes their brightness, while a dark robot passes in
// front of them every minute.
TEST_F(SlowLightTest, SomeoneWhomTheLightPassesIsForegroundAgain) {
  const cv::Rect person(120, 0, 40, 120);
  const cv::Mat floor(kSize, CV_64FC1, cv::Scalar(100));
  const Reference reference = Reference::FromImages(ExposeSeries(floor, 20, 1.5, random_));
  SlowLight light;
  cv::Mat foreground;
  constexpr int kSeconds = 1200;
  for (int second = 0; second <= kSeconds; ++second) {
    cv::Mat seen = Sloped(floor, 0.3 * second / kSeconds);
    const bool robot = second % 60 >= 57;
    cv::rectangle(seen, person, cv::Scalar(robot ? 50 : 110), cv::FILLED);
    const cv::Mat image = Expose(seen, 1, 1.5, random_);
    foreground = Foreground(image, reference, {}, light);
    light = light.Learn(image, reference, foreground, 1);
  }
  EXPECT_GT(cv::countNonZero(foreground(person)), 0.9 * person.area());
}

TEST_F(SlowLightTest, PlaceThatWasHiddenForLongIsLearntAgainOnceItIsSeen) {
  const cv::Rect person(120, 0, 40, 120);
  // Until they leave the light changes by a plane; then in a way that no plane through the other
  // places has.
  const auto light_at = [&](double time) {
    cv::Mat light = Sloped(cell_, 0.2 * std::min(time, 0.5));
    if (time < 0.5) cv::rectangle(light, person, cv::Scalar(40), cv::FILLED);
    for (int x = 0; x < light.cols && time > 0.5; ++x) {
      const double place = static_cast<double>(x) / (light.cols - 1);
      light.col(x) *= 1 + 0.2 * (time - 0.5) * (3 * place * place - 1);
    }
    return light;
  };
  EXPECT_LT(ForegroundPixels(light_at(1), LearnForAnHour(light_at)), 200);
}

TEST_F(SlowLightTest, LightThatChangesSlowlyAndUnevenlyIsFollowed) {
  const auto sun = [&](double time) { return Sloped(cell_, 0.25 * time); };
  EXPECT_GT(ForegroundPixels(sun(1), {}), 2000);
  const SlowLight light = LearnForAnHour(sun);
  EXPECT_LT(ForegroundPixels(sun(1), light), 50);
  EXPECT_NEAR(light.At(150, 60, kSize) / light.At(10, 60, kSize), 1.22 / 0.78, 0.06);
}

TEST_F(SlowLightTest, TheNoiseOfSingleImagesIsNotLearnt) {
  SlowLight light;
  for (int second = 0; second < 120; ++second) {
    const cv::Mat image = Expose(cell_, 1, 1.5, random_);
    light = light.Learn(image, reference_, Foreground(image, reference_, {}, light), 1);
  }
  for (const int x : {0, 5, 80, 155, 159}) EXPECT_NEAR(light.At(x, 60, kSize), 1, 0.004) << x;
  EXPECT_EQ(ForegroundPixels(cell_, light), 0);
}

TEST_F(SlowLightTest, NothingIsLearntFromALampThatIsSwitchedOn) {
  SlowLight light;
  const cv::Mat image = Expose(Sloped(cell_, 0.3), 1, 1.5, random_);
  for (int i = 0; i < 10; ++i) {
    light = light.Learn(image, reference_, Foreground(image, reference_, {}, light), 0.1);
  }
  for (const int x : {5, 80, 155}) {
    EXPECT_NEAR(light.At(x, 60, kSize), 1, 10 * 0.1 * SlowLight::kRate + 1e-9);
  }
}

TEST_F(SlowLightTest, FactorsStayWithinTheirLimits) {
  SlowLight light;
  const cv::Mat none = cv::Mat::zeros(kSize, CV_8UC1);
  const cv::Mat image = Expose(Sloped(cell_, 0.9), 1, 1.5, random_);
  for (int i = 0; i < 5; ++i) light = light.Learn(image, reference_, none, 1e6);
  for (int x = 0; x < kSize.width; ++x) {
    // Beyond the outermost tiles' middles the lines go on by half a tile.
    EXPECT_LE(std::abs(light.At(x, 0, kSize) - 1), 2 * SlowLight::kMost);
  }
}

TEST_F(SlowLightTest, RowIsWhatItsPixelsAre) {
  const SlowLight light = LearnForAnHour([&](double time) { return Sloped(cell_, 0.2 * time); });
  for (const cv::Size size : {kSize, cv::Size(37, 11), cv::Size(5, 3)}) {
    std::vector<float> row(static_cast<size_t>(size.width));
    for (int y = 0; y < size.height; ++y) {
      light.Row(y, size, row);
      for (int x = 0; x < size.width; ++x) {
        ASSERT_NEAR(row[static_cast<size_t>(x)], light.At(x, y, size), 1e-4) << size << x;
      }
    }
  }
}

TEST_F(SlowLightTest, UnlikeSizesAreRefused) {
  const cv::Mat image(kSize, CV_8UC1, cv::Scalar(1));
  const cv::Mat other(10, 10, CV_8UC1, cv::Scalar(1));
  EXPECT_THROW(SlowLight().Learn(other, reference_, image, 1), std::invalid_argument);
  EXPECT_THROW(SlowLight().Learn(image, reference_, other, 1), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
