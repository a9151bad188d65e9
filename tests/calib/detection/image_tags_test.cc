// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/image_tags.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/calib/detection/rendered_board.h"

namespace silhouette {
namespace {

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

TEST(ImageTags, CountsTheTagsOfTheBoardsThatAreSeen) {
  TagDetector detector({"tagStandard41h12"});
  const std::vector<Board> boards = {ImageTagsBoardOf("two", 2, 0),
                                     ImageTagsBoardOf("elsewhere", 1, 9)};
  const ImageTags found = FindTags(detector, Rendered().image(), {}, boards);
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

TEST(ImageTags, ForeignTagsAreLeftOut) {
  TagDetector detector({"tagStandard41h12"});
  const std::vector<Board> boards = {ImageTagsBoardOf("one", 1, 1)};
  const ImageTags found = FindTags(detector, Rendered().image(), {}, boards);
  ASSERT_EQ(found.tags.size(), 1u);
  EXPECT_EQ(found.tags.front().tag, 1);
  ASSERT_EQ(found.foreign.size(), 1u);
  EXPECT_EQ(found.foreign.front().tag, 0);
}

TEST(ImageTags, TagThatIsThereTwiceIsLeftOut) {
  TagDetector detector({"tagStandard41h12"});
  const std::vector<Board> boards = {ImageTagsBoardOf("two", 2, 0)};
  cv::Mat twice;
  cv::vconcat(Rendered().image(), Rendered().image(), twice);
  const ImageTags found = FindTags(detector, twice, {}, boards);
  EXPECT_TRUE(found.tags.empty());
  EXPECT_EQ(found.ambiguous.size(), 4u);
}

TEST(ImageTags, MirroredBoardIsToldFromNone) {
  TagDetector detector({"tagStandard41h12"});
  const std::vector<Board> boards = {ImageTagsBoardOf("two", 2, 0)};
  const ImageTags mirrored = FindTags(detector, Rendered({.mirrored = true}).image(), {}, boards);
  EXPECT_TRUE(mirrored.tags.empty());
  EXPECT_TRUE(mirrored.mirrored);
  EXPECT_FALSE(FindTags(detector, cv::Mat(240, 320, CV_8UC1, cv::Scalar(99)), {}, boards).mirrored);
}

TEST(ImageTags, TellWhetherAnythingMoved) {
  TagDetector detector({"tagStandard41h12"});
  const std::vector<Board> boards = {ImageTagsBoardOf("two", 2, 0)};
  const auto found = [&](double noise, double shift) {
    return FindTags(detector, Rendered({.noise = noise}, shift).image(), {}, boards);
  };
  const ImageTags first = found(2, 0);
  EXPECT_TRUE(ShowTheSame(first, found(3, 0)));
  EXPECT_NE(first.digest, found(3, 0).digest);
  EXPECT_EQ(first.digest, found(2, 0).digest);
  // A millimetre is a pixel.
  EXPECT_FALSE(ShowTheSame(first, found(2, 0.001)));
}

TEST(ImageTags, SightingsCarryFrameViewAndSigma) {
  TagDetector detector({"tagStandard41h12"});
  const std::vector<Board> boards = {ImageTagsBoardOf("two", 2, 0)};
  ImageTags found = FindTags(detector, Rendered().image(), {}, boards);
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
