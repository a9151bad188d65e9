// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/difference.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "capture/segmentation/brightness.h"
#include "capture/segmentation/deviating_pixels.h"
#include "capture/segmentation/down_sampling.h"
#include "tests/capture/segmentation/images.h"
#include "tests/random.h"

namespace silhouette {
namespace {

// Judges one pixel at a time, as the settings' comments say it.
class PlainSegmentation {
 public:
  using Plane = std::vector<std::vector<bool>>;

  static Plane Foreground(const cv::Mat& image, const Reference& reference,
                          const SegmentationSettings& settings) {
    const PlainSegmentation plain(image.cols, image.rows, settings.clean_up_radius);
    Plane plane(static_cast<size_t>(image.rows),
                std::vector<bool>(static_cast<size_t>(image.cols)));
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        bool deviates = false;
        for (int c = 0; c < image.channels(); ++c) {
          const double difference = std::abs(Difference(image, reference, x, y, c)) / 128.0;
          deviates |= difference > settings.noise_factor * Noise(reference, x, y, c) / 256.0 &&
                      difference > settings.min_difference;
        }
        plane[size_t(y)][size_t(x)] = deviates;
      }
    }
    plane = WithFaint(plane, image, reference, settings);
    plane = plain.Dilate(plain.Erode(plane));
    plane = plain.Erode(plain.Dilate(plane));
    return plain.WithoutBlobsBelow(plane, settings.min_blob_pixels);
  }

 private:
  // In 128ths of a grey level; the mean is cut off to such.
  static int Difference(const cv::Mat& image, const Reference& reference, int x, int y, int c) {
    const int i = x * image.channels() + c;
    const int mean = reference.mean().ptr<uint16_t>(y)[i];
    const int difference = image.ptr<uint8_t>(y)[i] * 128 - mean / 2;
    return mean >= 250 * 256 ? std::min(difference, 0) : difference;
  }
  // In 256ths of a grey level.
  static int Noise(const Reference& reference, int x, int y, int c) {
    return reference.noise().ptr<uint16_t>(y)[x * reference.channels() + c];
  }

  static Plane WithFaint(const Plane& plane, const cv::Mat& image, const Reference& reference,
                         const SegmentationSettings& settings) {
    Plane result = plane;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        for (int c = 0; c < image.channels(); ++c) {
          if (IsFaint(plane, image, reference, settings, x, y, c)) {
            result[size_t(y)][size_t(x)] = true;
          }
        }
      }
    }
    return result;
  }

  static bool IsFaint(const Plane& plane, const cv::Mat& image, const Reference& reference,
                      const SegmentationSettings& settings, int x, int y, int c) {
    const int reach = settings.faint_side / 2;
    double sum = 0, noise = 0, squares = 0, variance = 0, count = 0;
    for (int v = std::max(y - reach, 0); v <= std::min(y + reach, image.rows - 1); ++v) {
      for (int u = std::max(x - reach, 0); u <= std::min(x + reach, image.cols - 1); ++u) {
        if (plane[size_t(v)][size_t(u)]) continue;
        const int difference = Difference(image, reference, u, v, c);
        sum += difference / 128.0;
        noise += Noise(reference, u, v, c) / 256.0;
        ++count;
        if (Noise(reference, u, v, c) > std::max(3 * reference.typical_noise(), 256)) continue;
        squares += std::pow((std::abs(difference) / 8) / 16.0, 2);
        variance += std::pow((Noise(reference, u, v, c) / 16) / 16.0, 2);
      }
    }
    if (count < settings.faint_side * settings.faint_side / 2.0) return false;
    // |mean| > noise_factor * mean noise / sqrt(count), squared.
    if (settings.faint_difference > 0 && std::abs(sum) > settings.faint_difference * count &&
        sum * sum * count > std::pow(settings.noise_factor * noise, 2)) {
      return true;
    }
    const double beyond = squares - variance;
    return settings.texture_difference > 0 &&
           beyond > std::pow(settings.texture_difference, 2) * count &&
           beyond * beyond * count > 2 * std::pow(settings.noise_factor * variance, 2);
  }

  PlainSegmentation(int width, int height, int radius)
      : width_(width), height_(height), radius_(radius) {}

  bool Inside(int x, int y) const { return x >= 0 && x < width_ && y >= 0 && y < height_; }

  // Whether some (or, with `all`, every) pixel of the image within the disc around (x, y) is set.
  bool Within(const Plane& plane, int x, int y, bool all) const {
    for (int dy = -radius_; dy <= radius_; ++dy) {
      const double reach = radius_ == 0 ? 0 : std::sqrt(double(radius_ * radius_ - dy * dy));
      const int dx_limit = static_cast<int>(std::lround(reach));
      for (int dx = -dx_limit; dx <= dx_limit; ++dx) {
        if (!Inside(x + dx, y + dy)) continue;
        if (plane[size_t(y + dy)][size_t(x + dx)] != all) return !all;
      }
    }
    return all;
  }
  Plane Each(const Plane& plane, bool all) const {
    Plane result = plane;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) result[size_t(y)][size_t(x)] = Within(plane, x, y, all);
    }
    return result;
  }
  Plane Erode(const Plane& plane) const { return Each(plane, true); }
  Plane Dilate(const Plane& plane) const { return Each(plane, false); }

  Plane WithoutBlobsBelow(Plane plane, int min_pixels) const {
    cv::Mat set(height_, width_, CV_8UC1), labels, statistics, centres;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) set.at<uint8_t>(y, x) = plane[size_t(y)][size_t(x)];
    }
    cv::connectedComponentsWithStats(set, labels, statistics, centres, 8);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const int area = statistics.at<int>(labels.at<int>(y, x), cv::CC_STAT_AREA);
        if (set.at<uint8_t>(y, x) != 0 && area < min_pixels) plane[size_t(y)][size_t(x)] = false;
      }
    }
    return plane;
  }

  int width_;
  int height_;
  int radius_;
};

TEST(Foreground, AgreesWithAPlainSegmentation) {
  Random random;
  const auto up_to = [&](int limit) { return static_cast<int>(random() % uint64_t(limit)); };
  for (int round = 0; round < 40; ++round) {
    const cv::Size size(20 + up_to(60), 20 + up_to(60));
    const cv::Mat cell = EmptyCell(size);
    const int channels = round % 2 == 0 ? 1 : 3;
    const auto expose = [&](const cv::Mat& light, double sigma) {
      std::vector<cv::Mat> planes;
      for (int c = 0; c < channels; ++c) {
        planes.push_back(Expose(light, 1 + 0.35 * c, sigma, random));
      }
      cv::Mat image;
      cv::merge(planes, image);
      return image;
    };
    std::vector<cv::Mat> images;
    const double noise = up_to(30) / 10.0;
    for (int i = 2 + up_to(10); i > 0; --i) images.push_back(expose(cell, noise));
    const Reference reference = Reference::FromImages(images);
    cv::Mat light = cell.clone();
    for (int i = up_to(6); i > 0; --i) {
      const cv::Rect box(up_to(size.width), up_to(size.height), 1 + up_to(12), 1 + up_to(12));
      cv::rectangle(light, box, cv::Scalar(up_to(256)), cv::FILLED);
    }
    const cv::Mat image = expose(light, 6);  // so noisy that specks are left to clean up
    const SegmentationSettings settings{.noise_factor = up_to(32) / 4.0,  // exact in any precision
                                        .min_difference = static_cast<double>(up_to(20)),
                                        .faint_difference = up_to(3) * up_to(8) / 4.0,
                                        .texture_difference = up_to(3) * up_to(8) / 4.0,
                                        .faint_side = 3 + 2 * up_to(7),
                                        .follow_brightness = false,
                                        .clean_up_radius = up_to(4),
                                        .min_blob_pixels = up_to(30)};
    const cv::Mat foreground = Foreground(image, reference, settings);
    const PlainSegmentation::Plane plain =
        PlainSegmentation::Foreground(image, reference, settings);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        ASSERT_EQ(foreground.at<uint8_t>(y, x), plain[size_t(y)][size_t(x)] ? 255 : 0)
            << "pixel " << x << ", " << y << " of " << size << "\n"
            << Describe(settings);
      }
    }
  }
}

TEST(GradedForeground, StrongIsWhatHigherLimitsFind) {
  Random random;
  const auto up_to = [&](int limit) { return static_cast<int>(random() % unsigned(limit)); };
  int weak = 0;
  for (int i = 0; i < 60; ++i) {
    const cv::Size size(20 + up_to(60), 20 + up_to(40));
    const cv::Mat cell(size, CV_64FC1, cv::Scalar(100));
    const Reference reference = Reference::FromImages(ExposeSeries(cell, 10, 1.5, random));
    cv::Mat light = cell.clone();
    for (int boxes = 3; boxes > 0; --boxes) {
      const cv::Rect box(up_to(size.width), up_to(size.height), 5 + up_to(20), 5 + up_to(20));
      cv::rectangle(light, box, cv::Scalar(97 + up_to(8)), cv::FILLED);
    }
    const cv::Mat image = Expose(light, 1, 1.5, random);
    SegmentationSettings settings;
    const cv::Mat graded = GradedForeground(image, reference, settings);
    const cv::Mat found = Foreground(image, reference, settings);
    EXPECT_EQ(cv::norm(graded > kThinEvidence, found, cv::NORM_INF), 0);
    settings.faint_difference *= kStrongFactor;
    settings.texture_difference *= kStrongFactor;
    const cv::Mat strong = Foreground(image, reference, settings);
    EXPECT_EQ(cv::norm(graded == kStrongEvidence, strong, cv::NORM_INF), 0);
    weak += cv::countNonZero(graded == kWeakEvidence);
    const GradedMask mask = Graded(graded, {10, 10}, 0);
    EXPECT_EQ(mask.all, DownSample(found, {10, 10}, 0));
    EXPECT_EQ(mask.strong, DownSample(strong, {10, 10}, kStrongCover));
  }
  EXPECT_GT(weak, 1000);
}

TEST(GradedForeground, StrongEvidenceOnASliverOfAMaskPixelIsWeak) {
  cv::Mat foreground = cv::Mat::zeros({100, 100}, CV_8UC1);
  foreground(cv::Rect(10, 10, 5, 1)) = kStrongEvidence;  // 5 % of the mask pixel 1, 1
  foreground(cv::Rect(30, 10, 6, 1)) = kStrongEvidence;  // 6 % of 3, 1
  foreground(cv::Rect(50, 10, 10, 10)) = kWeakEvidence;  // all of 5, 1
  const GradedMask mask = Graded(foreground, {10, 10}, 0);
  EXPECT_TRUE(mask.all.at(1, 1) && mask.all.at(3, 1) && mask.all.at(5, 1));
  EXPECT_EQ(mask.all.Count(), 3);
  EXPECT_TRUE(mask.strong.at(3, 1));
  EXPECT_EQ(mask.strong.Count(), 1);
  EXPECT_EQ(Graded(foreground, {10, 10}, 0.1).strong.Count(), 0) << "min_cover counts, too";
}

TEST(Difference, EmptyCellIsBackgroundUnderNoiseAndDrift) {
  // Of other seeds, one in 600 gives a false pixel, where the reference is of two images only.
  std::mt19937_64 random(3);
  const cv::Mat cell = EmptyCell({320, 240});
  for (const int images : {2, 5, 20}) {
    const Reference reference = Reference::FromImages(ExposeSeries(cell, images, 2, random));
    for (const double gain : {0.90, 0.95, 1.0, 1.03, 1.10}) {
      const cv::Mat image = Expose(cell, gain, 2, random);
      EXPECT_TRUE(Difference(image, reference, {}, {64, 64}).Empty())
          << images << " reference images, brightness " << gain;
    }
  }
}

TEST(Difference, RobotIsFoundAndNothingElse) {
  std::mt19937_64 random(5);
  const cv::Mat cell = EmptyCell({320, 240});
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 20, 2, random));
  const cv::Rect robot(100, 60, 45, 90);
  cv::Mat light = cell.clone();
  cv::rectangle(light, robot, cv::Scalar(225), cv::FILLED);
  for (const double gain : {0.9, 1.0, 1.1}) {
    const Mask mask = Difference(Expose(light, gain, 2, random), reference, {}, {64, 48});
    EXPECT_EQ(mask,
              Mask::FromPredicate(
                  {64, 48}, [](int x, int y) { return x >= 20 && x < 29 && y >= 12 && y < 30; }))
        << "brightness " << gain;
  }
}

TEST(Difference, SpeckIsDroppedAndPinholeIsFilled) {
  SegmentationSettings settings;
  const cv::Mat empty(40, 40, CV_8UC1, cv::Scalar(100));
  const Reference reference = Reference::FromImages(std::vector<cv::Mat>{empty, empty});
  cv::Mat image = empty.clone();
  image.at<uint8_t>(5, 5) = 200;
  EXPECT_EQ(cv::countNonZero(Foreground(image, reference, settings)), 0);
  cv::rectangle(image, cv::Rect(10, 10, 12, 12), cv::Scalar(200), cv::FILLED);
  image.at<uint8_t>(16, 16) = 100;
  const cv::Mat foreground = Foreground(image, reference, settings);
  EXPECT_EQ(foreground.at<uint8_t>(16, 16), 255);
  settings.clean_up_radius = 0;
  settings.min_blob_pixels = 0;
  EXPECT_EQ(cv::countNonZero(Foreground(image, reference, settings)), 12 * 12);  // speck, no hole
}

// Two fingers of a gripper, each of two camera pixels: the opening takes away less than three.
TEST(Difference, ThinPartsOfTheRobotStayInItsMask) {
  const cv::Mat empty(64, 64, CV_8UC1, cv::Scalar(100));
  const Reference reference = Reference::FromImages(std::vector<cv::Mat>{empty, empty});
  cv::Mat image = empty.clone();
  cv::rectangle(image, cv::Rect(10, 10, 16, 16), cv::Scalar(200), cv::FILLED);
  cv::rectangle(image, cv::Rect(26, 11, 9, 2), cv::Scalar(200), cv::FILLED);
  cv::rectangle(image, cv::Rect(26, 22, 9, 2), cv::Scalar(200), cv::FILLED);
  cv::rectangle(image, cv::Rect(50, 50, 2, 9), cv::Scalar(200), cv::FILLED);  // joins nothing
  const SegmentationSettings settings{.faint_difference = 0, .texture_difference = 0};
  const Mask robot = RobotMask(image, reference, settings, {64, 64});
  for (int x = 10; x < 35; ++x) {
    EXPECT_TRUE(robot.at(x, 11) && robot.at(x, 12) && robot.at(x, 22) && robot.at(x, 23)) << x;
  }
  EXPECT_FALSE(robot.at(30, 14)) << "between the fingers";
  EXPECT_FALSE(robot.at(50, 54));
  const GradedMask scene = Graded(GradedForeground(image, reference, settings), {64, 64}, 0);
  EXPECT_EQ(scene.all, Difference(image, reference, settings, {64, 64}));
  EXPECT_FALSE(scene.all.at(30, 11)) << "in a scene noise could be as thin";
  EXPECT_EQ(scene.all | scene.thin, robot);
  EXPECT_TRUE((scene.all & scene.thin).Empty());
  SegmentationSettings without = settings;
  without.keep_thin_parts = false;
  EXPECT_EQ(RobotMask(image, reference, without, {64, 64}), scene.all);
}

// A box 5 levels brighter than the cell: less than any pixel's threshold.
TEST(Difference, FaintObstacleIsFoundByItsMean) {
  Random random;
  const cv::Mat cell = EmptyCell({320, 240});
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 20, 1.5, random));
  const cv::Rect box(100, 80, 40, 60);
  cv::Mat light = cell.clone();
  light(box) += 5;
  const cv::Mat image = Expose(light, 1, 1.5, random);
  const cv::Mat foreground = Foreground(image, reference, {});
  EXPECT_GT(cv::countNonZero(foreground(box)), 0.9 * box.area());
  // It spreads by no more than half of what the mean is taken over.
  const int reach = SegmentationSettings{}.faint_side / 2 + 1;  // and a pixel of the clean-up
  const cv::Rect around(box.x - reach, box.y - reach, box.width + 2 * reach,
                        box.height + 2 * reach);
  EXPECT_EQ(cv::countNonZero(foreground), cv::countNonZero(foreground(around)));
  const SegmentationSettings alone{.faint_difference = 0, .texture_difference = 0};
  EXPECT_EQ(cv::countNonZero(Foreground(image, reference, alone)), 0);
}

TEST(Difference, WhatIsPlainlyVisibleDoesNotSpreadByTheMean) {
  const cv::Mat empty(60, 60, CV_8UC1, cv::Scalar(100));
  const Reference reference = Reference::FromImages(std::vector<cv::Mat>{empty, empty});
  cv::Mat image = empty.clone();
  const cv::Rect box(20, 20, 15, 15);
  cv::rectangle(image, box, cv::Scalar(200), cv::FILLED);
  const cv::Mat foreground = Foreground(image, reference, {});
  EXPECT_EQ(cv::countNonZero(foreground), cv::countNonZero(foreground(box)));
}

TEST(Brightness, IsNotBiasedByWhatStandsInTheCell) {
  Random random;
  const cv::Mat cell = EmptyCell({320, 240});
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 20, 2, random));
  for (const double gain : {0.9, 1.0, 1.1}) {
    for (const int width : {0, 60, 120, 180}) {  // the last covers more than half the image
      for (const int level : {20, 130, 200}) {
        cv::Mat light = cell.clone();
        cv::rectangle(light, cv::Rect(0, 0, width, 240), cv::Scalar(level), cv::FILLED);
        EXPECT_NEAR(BrightnessOf(Expose(light, gain, 2, random), reference).gain, gain, 0.01)
            << width << " columns of level " << level;
      }
    }
  }
}

TEST(Brightness, StrayLightIsAnOffset) {
  Random random;
  const cv::Mat cell = EmptyCell({320, 240});
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 20, 1.5, random));
  for (const double offset : {-15.0, 0.0, 12.0, 20.0}) {
    cv::Mat light = 0.9 * cell + offset;
    cv::rectangle(light, cv::Rect(40, 0, 120, 200), cv::Scalar(200), cv::FILLED);
    const cv::Mat image = Expose(light, 1, 1.5, random);
    const Brightness brightness = BrightnessOf(image, reference);
    EXPECT_NEAR(brightness.gain, 0.9, 0.01) << offset;
    EXPECT_NEAR(brightness.offset, offset, 1) << offset;
    const cv::Mat empty = Foreground(Expose(0.9 * cell + offset, 1, 1.5, random), reference, {});
    EXPECT_EQ(cv::countNonZero(empty), 0) << offset;
  }
}

TEST(Difference, SaturatedPixelsSayNothingByBeingBrighterThanExpected) {
  std::mt19937_64 random(8);
  cv::Mat cell = EmptyCell({160, 120});
  const cv::Rect window(60, 40, 50, 40);
  cell(window) = 320;  // more than the camera can show
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 20, 1.5, random));
  EXPECT_NEAR(reference.Describe().saturated, window.area(), 2);
  for (const double gain : {0.85, 1.0, 1.1}) {  // at the least still saturated
    EXPECT_TRUE(Difference(Expose(cell, gain, 1.5, random), reference, {}, {32, 32}).Empty());
  }
  cv::Mat light = cell.clone();
  light(cv::Rect(70, 50, 20, 20)) = 180;
  const Mask mask = Difference(Expose(light, 0.85, 1.5, random), reference, {}, {16, 12});
  EXPECT_EQ(mask.Count(), 4u);
}

TEST(Difference, TextureThatIsNotTheCellsIsFound) {
  Random random;
  cv::Mat cell(120, 160, CV_64FC1);
  std::normal_distribution<double> texture(100, 4);
  for (auto it = cell.begin<double>(); it != cell.end<double>(); ++it) *it = texture(random);
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 20, 1.5, random));
  const SegmentationSettings settings{.texture_difference = 2};
  EXPECT_EQ(cv::countNonZero(Foreground(Expose(cell, 1, 1.5, random), reference, settings)), 0);
  cv::Mat light = cell.clone();
  const cv::Rect board(50, 30, 60, 50);
  light(board) = 100;
  const cv::Mat image = Expose(light, 1, 1.5, random);
  EXPECT_GT(cv::countNonZero(Foreground(image, reference, settings)(board)), 0.95 * board.area());
  const SegmentationSettings without{.texture_difference = 0};
  EXPECT_LT(cv::countNonZero(Foreground(image, reference, without)(board)), 0.7 * board.area());
}

class ShadowsTest : public testing::Test {
 protected:
  static cv::Mat TexturedCell(std::mt19937_64& random) {
    cv::Mat cell(120, 160, CV_64FC1);
    std::normal_distribution<double> texture(120, 6);
    for (auto it = cell.begin<double>(); it != cell.end<double>(); ++it) *it = texture(random);
    return cell;
  }
  int Found(const cv::Mat& light) {
    return cv::countNonZero(
        Foreground(Expose(light, 1, 1.5, random_), reference_, kIgnoring)(box_));
  }

  static constexpr SegmentationSettings kIgnoring{.shadows = Shadows::kIgnore};
  Random random_;
  const cv::Mat cell_ = TexturedCell(random_);
  const Reference reference_ = Reference::FromImages(ExposeSeries(cell_, 20, 1.5, random_));
  const cv::Rect box_{50, 30, 60, 50};
};

TEST_F(ShadowsTest, ShadowOnTextureIsIgnoredIfAskedFor) {
  for (const double factor : {0.5, 0.7, 0.85}) {
    cv::Mat light = cell_.clone();
    light(box_) *= factor;
    EXPECT_EQ(Found(light), 0) << factor;
    const cv::Mat foreground = Foreground(Expose(light, 1, 1.5, random_), reference_, {});
    EXPECT_GT(cv::countNonZero(foreground(box_)), 0.95 * box_.area()) << factor;
  }
}

TEST_F(ShadowsTest, DarkThingsAreNoShadows) {
  for (const double level : {20, 60, 84, 102}) {
    cv::Mat light = cell_.clone();
    light(box_) = level;
    EXPECT_GT(Found(light), 0.95 * box_.area()) << "of one colour, " << level;
    if (level > 90) continue;  // nearly the cell's own
    std::normal_distribution<double> texture(level, 6);
    for (int y = box_.y; y < box_.br().y; ++y) {
      for (int x = box_.x; x < box_.br().x; ++x) light.at<double>(y, x) = texture(random_);
    }
    EXPECT_GT(Found(light), 0.95 * box_.area()) << "with a texture of its own, " << level;
  }
}

TEST_F(ShadowsTest, ThingInItsOwnShadowIsFound) {
  cv::Mat light = cell_.clone();
  light(cv::Rect(20, 20, 120, 80)) *= 0.7;
  light(box_) = 85;  // as dark as the shadow around it
  const cv::Mat foreground = Foreground(Expose(light, 1, 1.5, random_), reference_, kIgnoring);
  EXPECT_GT(cv::countNonZero(foreground(box_)), 0.8 * box_.area());
  EXPECT_LT(cv::countNonZero(foreground) - cv::countNonZero(foreground(box_)), 300);
}

TEST_F(ShadowsTest, ThingInAShadowThatIsAsBrightAsTheCellIsFound) {
  const cv::Mat plain = (cell_ - 120) / 2 + 120;
  const Reference reference = Reference::FromImages(ExposeSeries(plain, 20, 1.5, random_));
  for (const double level : {116, 120, 124}) {
    cv::Mat light = plain.clone();
    light(cv::Rect(20, 20, 120, 80)) *= 0.7;
    const cv::Rect thing{60, 40, 9, 40};
    light(thing) = level;
    const cv::Mat foreground = Foreground(Expose(light, 1, 1.5, random_), reference, kIgnoring);
    EXPECT_GT(cv::countNonZero(foreground(thing)), 0.6 * thing.area()) << level;
  }
}

// Where the robot is, it is not said to be missing because a shadow falls on its rim; in its images
// there is no shadow.
TEST_F(ShadowsTest, ShadowIsNeitherForegroundNorTheEmptyCell) {
  cv::Mat light = cell_.clone();
  light(box_) *= 0.7;
  const cv::Mat image = Expose(light, 1, 1.5, random_);
  const GradedMask shown = Graded(GradedForeground(image, reference_, kIgnoring), {16, 12}, 0);
  EXPECT_TRUE(shown.all.Empty());
  EXPECT_EQ(shown.thin, Mask::FromPredicate({16, 12}, [&](int x, int y) {
              return box_.contains(cv::Point(10 * x, 10 * y));
            }));
  EXPECT_TRUE(RobotMask(image, reference_, kIgnoring, {16, 12}).Empty());
}

// What belongs to the foreground beside it, and to no shadow, does not hide its texture.
TEST_F(ShadowsTest, NarrowShadowOnFaintTextureIsIgnored) {
  const cv::Mat plain = (cell_ - 120) / 2 + 120;
  const Reference reference = Reference::FromImages(ExposeSeries(plain, 20, 1.5, random_));
  cv::Mat light = plain.clone();
  const cv::Rect arm{40, 20, 9, 80};
  light(arm) *= 0.7;
  for (int i = 0; i < 20; ++i) {
    const cv::Mat image = Expose(light, 1, 1.5, random_);
    EXPECT_GT(cv::countNonZero(Foreground(image, reference, {})), 0.95 * arm.area());
    EXPECT_LT(cv::countNonZero(Foreground(image, reference, kIgnoring)), 0.02 * arm.area());
  }
}

// On a cell without texture a shadow stays; that it is a thing is no more than possible.
TEST_F(ShadowsTest, EvidenceThatAShadowCouldExplainIsWeak) {
  const cv::Mat plain(120, 160, CV_64FC1, cv::Scalar(120));
  const Reference reference = Reference::FromImages(ExposeSeries(plain, 20, 1.5, random_));
  const auto evidence = [&](double level, const SegmentationSettings& settings) {
    cv::Mat light = plain.clone();
    light(box_) = level;
    const cv::Mat graded = GradedForeground(Expose(light, 1, 1.5, random_), reference, settings);
    EXPECT_GT(cv::countNonZero(graded), 0.95 * box_.area()) << level;
    return cv::countNonZero(graded(box_) == kStrongEvidence) / double(box_.area());
  };
  EXPECT_EQ(evidence(84, kIgnoring), 0);
  EXPECT_GT(evidence(84, {}), 0.95);
  EXPECT_GT(evidence(20, kIgnoring), 0.95) << "darker than a shadow";
  EXPECT_GT(evidence(160, kIgnoring), 0.95) << "brighter than the cell";
}

TEST_F(ShadowsTest, WithoutTextureAShadowStaysForeground) {
  const cv::Mat plain(120, 160, CV_64FC1, cv::Scalar(120));
  const Reference reference = Reference::FromImages(ExposeSeries(plain, 20, 1.5, random_));
  cv::Mat light = plain.clone();
  light(box_) *= 0.7;
  const cv::Mat foreground = Foreground(Expose(light, 1, 1.5, random_), reference, kIgnoring);
  EXPECT_GT(cv::countNonZero(foreground(box_)), 0.95 * box_.area());
}

TEST(Difference, ColourIsSeenWhereGreyIsTheSame) {
  const cv::Mat cell(60, 80, CV_8UC3, cv::Scalar(100, 100, 100));
  const Reference colour = Reference::FromImages(std::vector<cv::Mat>{cell, cell});
  cv::Mat image = cell.clone();
  const cv::Rect box(20, 20, 20, 15);
  image(box) = cv::Scalar(100, 90, 120);                                       // as grey: 100.1
  EXPECT_GE(cv::countNonZero(Foreground(image, colour, {})), box.area() - 4);  // corners
  EXPECT_EQ(cv::countNonZero(Foreground(image, colour.AsGrey(), {})), 0);
  // A camera that gives grey all at once.
  EXPECT_EQ(cv::countNonZero(Foreground(Grey(image), colour, {})), 0);
  cv::rectangle(image, box, cv::Scalar(130, 130, 130), cv::FILLED);
  EXPECT_GE(cv::countNonZero(Foreground(Grey(image), colour, {})), box.area() - 4);
}

TEST(Brightness, LightSwitchedOffIsNoDrift) {
  std::mt19937_64 random(6);
  const cv::Mat cell = EmptyCell({160, 120});
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 10, 2, random));
  const cv::Mat dark = Expose(cell, 0.1, 2, random);
  EXPECT_EQ(BrightnessOf(dark, reference).gain, 1);
  EXPECT_EQ(Difference(dark, reference, {}, {32, 32}).Count(), 32u * 32u);
}

TEST(Difference, WithoutFollowingTheLightDriftIsForeground) {
  std::mt19937_64 random(7);
  const cv::Mat cell = EmptyCell({160, 120});
  const Reference reference = Reference::FromImages(ExposeSeries(cell, 10, 1, random));
  const SegmentationSettings settings{.follow_brightness = false};
  EXPECT_GT(Difference(Expose(cell, 1.2, 1, random), reference, settings, {32, 32}).Count(), 500u);
}

TEST(Difference, ImageOfAnotherSizeIsRefused) {
  const cv::Mat empty(40, 40, CV_8UC1, cv::Scalar(100));
  const Reference reference = Reference::FromImages(std::vector<cv::Mat>{empty, empty});
  EXPECT_THROW(Difference(cv::Mat(40, 41, CV_8UC1), reference, {}, {8, 8}), std::invalid_argument);
  EXPECT_THROW(Difference(cv::Mat(), reference, {}, {8, 8}), std::invalid_argument);
}

TEST(Difference, ImpossibleSettingsAreRefused) {
  const cv::Mat empty(40, 40, CV_8UC1, cv::Scalar(100));
  const Reference reference = Reference::FromImages(std::vector<cv::Mat>{empty, empty});
  using Settings = SegmentationSettings;
  for (const Settings& settings :
       {Settings{.noise_factor = -1}, Settings{.min_difference = std::nan("")},
        Settings{.faint_difference = -1}, Settings{.texture_difference = -1},
        Settings{.faint_side = 4}, Settings{.faint_side = 17}, Settings{.clean_up_radius = -1},
        Settings{.clean_up_radius = 16}, Settings{.min_blob_pixels = -1},
        Settings{.min_cover = 1}}) {
    EXPECT_THROW(Difference(empty, reference, settings, {8, 8}), std::invalid_argument)
        << Describe(settings);
  }
}

TEST(SegmentationSettings, DescriptionIsSortedAndComplete) {
  EXPECT_EQ(Describe({}),
            "clean_up_radius: 1\nfaint_difference: 2\nfaint_side: 9\nfollow_brightness: true\n"
            "keep_thin_parts: true\nmin_blob_pixels: 12\nmin_cover: 0\n"
            "min_difference: 8\nnoise_factor: 6\n"
            "texture_difference: 2.25\n");
  EXPECT_EQ(Describe({.faint_difference = 4, .faint_side = 3, .shadows = Shadows::kIgnore}),
            "clean_up_radius: 1\nfaint_difference: 4\nfaint_side: 3\nfollow_brightness: true\n"
            "keep_thin_parts: true\nmin_blob_pixels: 12\nmin_cover: 0\n"
            "min_difference: 8\nnoise_factor: 6\n"
            "shadows: ignore\ntexture_difference: 2.25\n");
}

// As databases have them that were made when these were the defaults, or before there were such
// keys.
TEST(SegmentationSettings, DescriptionsOfEarlierDatabasesSayWhatTheySaid) {
  EXPECT_EQ(Describe({.faint_difference = 3,
                      .texture_difference = 0,
                      .faint_side = 5,
                      .keep_thin_parts = false}),
            "clean_up_radius: 1\nfaint_difference: 3\nfollow_brightness: true\n"
            "min_blob_pixels: 12\nmin_cover: 0\nmin_difference: 8\nnoise_factor: 6\n");
  EXPECT_EQ(Describe({.faint_difference = 3,
                      .texture_difference = 1.5,
                      .faint_side = 9,
                      .keep_thin_parts = false}),
            "clean_up_radius: 1\nfaint_difference: 3\nfaint_side: 9\nfollow_brightness: true\n"
            "min_blob_pixels: 12\nmin_cover: 0\nmin_difference: 8\nnoise_factor: 6\n"
            "texture_difference: 1.5\n");
  EXPECT_EQ(Describe({.noise_factor = 1.0 / 3,
                      .faint_difference = 0,
                      .texture_difference = 0,
                      .follow_brightness = false,
                      .keep_thin_parts = false,
                      .min_cover = 0.1}),
            "clean_up_radius: 1\nfollow_brightness: false\nmin_blob_pixels: 12\nmin_cover: 0.1\n"
            "min_difference: 8\nnoise_factor: 0.3333333333333333\n");
}

TEST(SegmentationSettings, CellFileLineHasWhatIsNoDefault) {
  EXPECT_EQ(CellFileLine({}), "segmentation: {}");
  EXPECT_EQ(CellFileLine({.texture_difference = 0, .shadows = Shadows::kIgnore}),
            "segmentation: {shadows: ignore, texture_difference: 0}");
}

}  // namespace
}  // namespace silhouette
