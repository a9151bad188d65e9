// SPDX-License-Identifier: Apache-2.0
// The corners of tags against where they really are, in rendered images.
#include <gtest/gtest.h>
#include <algorithm>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "calib/detection/image_tags.h"
#include "calib/detection/tag_detector.h"
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
  double white = 210;  // grey level; above 255 it is cut off
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
        {.blur = test.blur, .white = test.white}, random);
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

TEST(TagDetector, CornersBesideSaturatedPaperStateHowFarTheyAreOff) {
  for (double white : {262, 290}) {
    SCOPED_TRACE(white);
    const Errors errors = ErrorsOf({.white = white, .images = 2});
    EXPECT_EQ(errors.fitted, errors.tags);
    EXPECT_LT(errors.chi2, 2.3);
    EXPECT_GT(errors.chi2, 0.03);
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

constexpr double kImageTagsTag = 0.05;

Board ImageTagsBoardOf(const std::string& name, int columns, int first_id) {
  return Board({.name = name,
                .rows = 1,
                .columns = columns,
                .tag_size = kImageTagsTag,
                .gap = columns > 1 ? kImageTagsTag : 0,
                .first_id = first_id});
}

// Tags 0 and 1, about 50 pixels large.
RenderedBoard Rendered(const RenderSettings& settings = {}, double shift = 0) {
  const Board board = ImageTagsBoardOf("two", 2, 0);
  std::mt19937_64 random(1);
  Eigen::Isometry3d pose = RandomPose(board, 0.3, 0.2, random);
  pose.pretranslate(Eigen::Vector3d(shift, 0, 0));
  return RenderedBoard(board, Intrinsics(320, 240, 300, 0), pose, settings, random);
}

class ImageTagsTest : public testing::Test {
 protected:
  ImageTags Find(const cv::Mat& image) const {
    BoardDetector detector(boards_);
    return FindTags(detector, image, std::nullopt);
  }

  std::vector<Board> boards_ = {ImageTagsBoardOf("two", 2, 0)};
};

TEST_F(ImageTagsTest, CountsTheTagsOfTheBoardsThatAreSeen) {
  boards_.push_back(ImageTagsBoardOf("elsewhere", 1, 9));
  const ImageTags found = Find(Rendered().image());
  EXPECT_EQ(found.tags.size(), 2u);
  EXPECT_EQ(found.expected, 2);
  EXPECT_TRUE(found.foreign.empty());
  EXPECT_FALSE(found.mirrored);
  EXPECT_EQ(found.at_rim, 0);
  EXPECT_NEAR(found.MeanSize(), 50, 8);
  EXPECT_NEAR(found.MedianBlur(), 0.55, 0.15);
  EXPECT_GT(found.TypicalSigma(), 0.004);
  EXPECT_LT(found.TypicalSigma(), 0.03);
}

TEST_F(ImageTagsTest, ForeignTagsAreLeftOut) {
  boards_ = {ImageTagsBoardOf("one", 1, 1)};
  const ImageTags found = Find(Rendered().image());
  ASSERT_EQ(found.tags.size(), 1u);
  EXPECT_EQ(found.tags.front().tag, 1);
  ASSERT_EQ(found.foreign.size(), 1u);
  EXPECT_EQ(found.foreign.front().tag, 0);
}

TEST_F(ImageTagsTest, TagThatIsThereTwiceIsLeftOut) {
  cv::Mat twice;
  cv::vconcat(Rendered().image(), Rendered().image(), twice);
  const ImageTags found = Find(twice);
  EXPECT_TRUE(found.tags.empty());
  EXPECT_EQ(found.ambiguous.size(), 4u);
}

TEST_F(ImageTagsTest, MirroredBoardIsToldFromNone) {
  const ImageTags mirrored = Find(Rendered({.mirrored = true}).image());
  EXPECT_TRUE(mirrored.tags.empty());
  EXPECT_TRUE(mirrored.mirrored);
  EXPECT_FALSE(Find(cv::Mat(240, 320, CV_8UC1, cv::Scalar(99))).mirrored);
}

TEST_F(ImageTagsTest, TellWhetherAnythingMoved) {
  const auto found = [&](double noise, double shift) {
    return Find(Rendered({.noise = noise}, shift).image());
  };
  const ImageTags first = found(2, 0);
  EXPECT_TRUE(ShowTheSame(first, found(3, 0)));
  EXPECT_NE(first.digest, found(3, 0).digest);
  EXPECT_EQ(first.digest, found(2, 0).digest);
  // A millimetre is a pixel.
  EXPECT_FALSE(ShowTheSame(first, found(2, 0.001)));
}

TEST_F(ImageTagsTest, SightingsCarryFrameViewAndSigma) {
  ImageTags found = Find(Rendered().image());
  found.view = "left";
  found.frame = "7";
  const std::vector<TagSighting> sightings = SightingsOf(found);
  ASSERT_EQ(sightings.size(), 2u);
  EXPECT_EQ(sightings[1].frame, "7");
  EXPECT_EQ(sightings[1].view, "left");
  EXPECT_EQ(sightings[1].tag, 1);
  EXPECT_EQ(sightings[1].corners, found.tags[1].corners);
  EXPECT_EQ(sightings[1].sigma, found.tags[1].sigma);
}

TEST(Coverage, CountsCornersByTheirPlace) {
  ImageTags image;
  image.size = {80, 60};
  DetectedTag tag;
  tag.corners = {Eigen::Vector2d(-0.4, -0.4), Eigen::Vector2d(9.4, 9.4), Eigen::Vector2d(9.6, 0),
                 Eigen::Vector2d(79.4, 59.4)};
  image.tags = {tag};
  Coverage coverage;
  coverage.Add(image);
  EXPECT_EQ(coverage.Count(0, 0), 2);
  EXPECT_EQ(coverage.Count(1, 0), 1);
  EXPECT_EQ(coverage.Count(7, 5), 1);
  EXPECT_DOUBLE_EQ(coverage.Share(), 3.0 / 48);
}

}  // namespace

}  // namespace silhouette
