// SPDX-License-Identifier: Apache-2.0
// The corners of tags against where they really are, in rendered images.
#include "calib/detection/tag_detector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "tests/calib/detection/rendered_board.h"

namespace silhouette {
namespace {

constexpr double kTagDetectorTag = 0.05;
constexpr double kFocal = 300;  // of images of 320 x 240 pixels

Board TagDetectorBoardOf(const std::string& family, int rows, int columns) {
  return Board({.name = "test",
                .family = family,
                .rows = rows,
                .columns = columns,
                .tag_size = kTagDetectorTag,
                .gap = kTagDetectorTag,
                .first_id = 3});
}

struct Errors {
  std::vector<double> rms;  // per image, per axis
  double worst = 0;         // of any corner, per axis
  double chi2 = 0;          // per degree of freedom
  size_t tags = 0;
  size_t fitted = 0;
};

struct Case {
  std::string family = "tagStandard41h12";
  int rows = 1;
  int columns = 2;
  double size = 60;  // of a tag, pixels
  double blur = 0.5;
  bool with_lens = true;
  int images = 4;
};

// Over images of a board by a camera with k1 = -0.2.
Errors ErrorsOf(const Case& test) {
  const Board board = TagDetectorBoardOf(test.family, test.rows, test.columns);
  TagDetector detector({test.family});
  Errors errors;
  double sum = 0;
  for (int seed = 1; seed <= test.images; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    const CameraIntrinsics k = Intrinsics(320, 240, kFocal, -0.2);
    const RenderedBoard rendered(
        board, k, RandomPose(board, kFocal * kTagDetectorTag / test.size, 0.4, random),
        {.blur = test.blur}, random);
    double squares = 0;
    const auto tags = detector.Detect(
        rendered.image(), test.with_lens ? std::optional(CameraModel(k)) : std::nullopt);
    // Of very small ones some may be missed.
    EXPECT_GE(tags.size(), (test.size < 20 ? 0.5 : 1) * board.tags());
    for (const DetectedTag& tag : tags) {
      EXPECT_TRUE(board.HasTag(tag.tag)) << tag.tag;
      if (!board.HasTag(tag.tag)) continue;
      for (int i = 0; i < 4; ++i) {
        const Eigen::Vector2d error = tag.corners[i] - rendered.Corner(tag.tag, i);
        squares += error.squaredNorm();
        sum += error.squaredNorm() / (tag.sigma * tag.sigma);
        errors.worst = std::max(errors.worst, error.cwiseAbs().maxCoeff());
      }
      ++errors.tags;
      errors.fitted += tag.fitted ? 1 : 0;
    }
    errors.rms.push_back(std::sqrt(squares / (8.0 * static_cast<double>(tags.size()))));
  }
  errors.chi2 = sum / (8.0 * static_cast<double>(errors.tags));
  std::sort(errors.rms.begin(), errors.rms.end());
  return errors;
}

TEST(TagDetector, CornersOfLargeTagsAreGoodToHundredthsOfAPixel) {
  const Errors errors = ErrorsOf({});
  EXPECT_EQ(errors.fitted, errors.tags);
  EXPECT_LT(errors.rms[errors.rms.size() / 2], 0.012);
  EXPECT_LT(errors.rms.back(), 0.02);
  EXPECT_LT(errors.worst, 0.06);
  EXPECT_GT(errors.chi2, 0.5);
  EXPECT_LT(errors.chi2, 1.6);
}

TEST(TagDetector, CornersAreNearlyAsGoodOfACameraThatNothingIsKnownOf) {
  const Errors errors = ErrorsOf({.with_lens = false});
  EXPECT_EQ(errors.fitted, errors.tags);
  EXPECT_LT(errors.rms[errors.rms.size() / 2], 0.018);
  EXPECT_LT(errors.rms.back(), 0.03);
  EXPECT_GT(errors.chi2, 0.5);
  EXPECT_LT(errors.chi2, 1.6);
}

TEST(TagDetector, OtherFamiliesAndBlurStayWithinTheirSigma) {
  for (const Case& test :
       {Case{.family = "tag36h11", .images = 2}, Case{.blur = 1.2, .images = 2},
        Case{.blur = 0, .images = 2}, Case{.rows = 2, .columns = 3, .size = 30, .images = 1}}) {
    SCOPED_TRACE(testing::Message() << test.family << " " << test.blur << " " << test.size);
    const Errors errors = ErrorsOf(test);
    EXPECT_EQ(errors.fitted, errors.tags);
    EXPECT_LT(errors.rms.back(), 0.03);
    EXPECT_GT(errors.chi2, 0.3);
    EXPECT_LT(errors.chi2, 1.6);
  }
}

TEST(TagDetector, SmallTagsKeepTheLibrarysCornersAndALargeSigma) {
  const Errors errors = ErrorsOf({.rows = 3, .columns = 5, .size = 12, .blur = 0.8, .images = 2});
  EXPECT_EQ(errors.fitted, 0u);
  EXPECT_LT(errors.rms.back(), 0.2);
  EXPECT_GT(errors.chi2, 0.2);
  EXPECT_LT(errors.chi2, 1.5);
}

TEST(TagDetector, CornersOfEveryFamilyAreInTheBoardsOrder) {
  for (const std::string& family : TagFamily::Names()) {
    SCOPED_TRACE(family);
    const Board board(
        {.name = "one", .family = family, .tag_size = kTagDetectorTag, .first_id = 5});
    std::mt19937_64 random(1);
    const CameraIntrinsics k = Intrinsics(200, 180, kFocal, -0.1);
    const RenderedBoard rendered(
        board, k, RandomPose(board, kFocal * kTagDetectorTag / 60, 0.3, random), {}, random);
    const auto tags = TagDetector({family}).Detect(rendered.image());
    ASSERT_EQ(tags.size(), 1u);
    EXPECT_EQ(tags.front().tag, 5);
    EXPECT_TRUE(tags.front().fitted);
    for (int i = 0; i < 4; ++i) {
      EXPECT_LT((tags.front().corners[i] - rendered.Corner(5, i)).norm(), 0.08) << i;
    }
  }
}

TEST(TagDetector, MirroredBoardIsNotTakenForAGoodOne) {
  const Board board = TagDetectorBoardOf("tagStandard41h12", 1, 2);
  std::mt19937_64 random(1);
  const Eigen::Isometry3d pose = RandomPose(board, kFocal * kTagDetectorTag / 50, 0.2, random);
  const CameraIntrinsics k = Intrinsics(320, 240, kFocal, 0);
  TagDetector detector({"tagStandard41h12"});
  EXPECT_EQ(detector.Detect(RenderedBoard(board, k, pose, {}, random).image()).size(), 2u);
  EXPECT_TRUE(
      detector.Detect(RenderedBoard(board, k, pose, {.mirrored = true}, random).image()).empty());
}

TEST(TagDetector, NoiseIsNoTag) {
  cv::Mat image(240, 320, CV_8UC1);
  cv::theRNG().state = 7;
  cv::randu(image, 0, 256);
  EXPECT_TRUE(TagDetector(TagFamily::Names()).Detect(image).empty());
}

TEST(TagDetector, WrongImagesAndFamiliesAreRefused) {
  EXPECT_THROW(TagDetector({}), std::invalid_argument);
  EXPECT_THROW(TagDetector({"tag36"}), std::invalid_argument);
  EXPECT_THROW(TagDetector({"tag36h11"}).Detect(cv::Mat(20, 20, CV_8UC3)), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
