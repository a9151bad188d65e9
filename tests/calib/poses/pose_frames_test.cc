// SPDX-License-Identifier: Apache-2.0
// Poses and images that are called differently find each other, or the reason is given.
#include "calib/poses/pose_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "calib/boards/sighting_file.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

using Names = std::vector<std::string>;

std::vector<RobotPose> PosesCalled(const Names& names) {
  std::vector<RobotPose> poses;
  for (const std::string& name : names) poses.push_back({.frame = name});
  return poses;
}

std::vector<RobotPose> Rows(size_t count) {
  std::vector<RobotPose> poses;
  for (size_t row = 1; row <= count; ++row) poses.push_back({.frame = NameOfRow(row)});
  return poses;
}

Names NamesOf(const std::vector<RobotPose>& poses) {
  Names names;
  for (const RobotPose& pose : poses) names.push_back(pose.frame);
  return names;
}

// The names that the poses get, or a refusal; and the warning.
struct Named {
  Names names;
  std::string message;
};

Named NamedBy(const Names& frames, std::vector<RobotPose> poses) {
  std::vector<TagSighting> sightings;
  for (const std::string& frame : frames) sightings.emplace_back().frame = frame;
  const auto said = NamePosesByFrames(sightings, poses);
  return {NamesOf(poses), said.ok() ? *said : std::string(said.status().message())};
}

TEST(PoseFrames, AreSortedAsPeopleCount) {
  EXPECT_TRUE(IsBefore("img2", "img10"));
  EXPECT_FALSE(IsBefore("img10", "img2"));
  EXPECT_TRUE(IsBefore("img009", "img10"));
  EXPECT_TRUE(IsBefore("a", "a1"));
  EXPECT_FALSE(IsBefore("a", "a"));
  EXPECT_TRUE(IsBefore("img01", "img1") != IsBefore("img1", "img01"));
}

TEST(PoseFrames, EqualNamesAreKeptWithoutAWord) {
  const Named named = NamedBy({"a", "b"}, PosesCalled({"b", "c"}));
  EXPECT_THAT(named.names, ElementsAre("b", "c"));
  EXPECT_THAT(named.message, IsEmpty());
}

TEST(PoseFrames, NamesOfFilesLoseFolderAndExtension) {
  EXPECT_THAT(NamedBy({"img1", "img2"}, PosesCalled({"images/img2.png", "images/img1.png"})).names,
              ElementsAre("img2", "img1"));
}

TEST(PoseFrames, OtherNamesBelongTogetherByTheirNumbersWithAWarning) {
  const Named named = NamedBy({"img2", "img10"}, PosesCalled({"0002", "0010", "0011"}));
  EXPECT_THAT(named.names, ElementsAre("img2", "img10", "0011"));
  EXPECT_THAT(named.message, AllOf(HasSubstr("2 of 3 robot poses"), HasSubstr("'0002' to 'img2'")));
  EXPECT_THAT(NamedBy({"img1", "img2", "img3"}, PosesCalled({"pose_2", "pose_3"})).names,
              ElementsAre("img2", "img3"));
  EXPECT_THAT(NamedBy({"img1"}, PosesCalled({"a"})).names, ElementsAre("a"));
  EXPECT_THAT(NamedBy({"img1"}, PosesCalled({"1403715.1"})).names, ElementsAre("1403715.1"));
}

TEST(PoseFrames, EqualTimeStampsMayBeWrittenDifferently) {
  const Named named = NamedBy({"10.100000", "10.200000"}, PosesCalled({"10.1000", "10.2", "10.3"}));
  EXPECT_THAT(named.names, ElementsAre("10.100000", "10.200000", "10.3"));
  EXPECT_THAT(named.message, IsEmpty());
}

TEST(PoseFrames, TimeStampsThatDifferALittleAreMatchedWithAWarningOfTheGreatestDifference) {
  const Names images = {"1700000000.100000", "1700000000.833000", "1700000001.566000"};
  const Named named = NamedBy(images, PosesCalled({"1700000000.102300", "1700000000.5",
                                                   "1700000000.834000", "1700000001.566000"}));
  EXPECT_THAT(named.names, ElementsAre(images[0], "1700000000.5", images[1], images[2]));
  EXPECT_THAT(named.message, AllOf(HasSubstr("3 of 3 images"), HasSubstr("0.0023 apart at most")));
  const Names far = {"1700000000.2", "1700000000.95"};
  EXPECT_EQ(NamedBy(images, PosesCalled(far)).names, far);
  const Names one = {"10.15"};
  EXPECT_EQ(NamedBy({"10.148", "10.152", "11", "12", "13"}, PosesCalled(one)).names, one)
      << "of two images";
}

TEST(PoseFrames, PosesCountedFromZeroAreNotMatchedWithImagesCountedFromOne) {
  const Names poses = {"pose_0", "pose_1", "pose_2"};
  const Named named = NamedBy({"img_1", "img_2", "img_3"}, PosesCalled(poses));
  EXPECT_EQ(named.names, poses);
  EXPECT_THAT(named.message,
              AllOf(HasSubstr("numbered 0 to 2, images 1 to 3"), HasSubstr("use the same names")));
  EXPECT_EQ(NamedBy({"img_1", "img_2"}, PosesCalled(poses)).names, poses);
  const Names from_one = {"pose_1", "pose_2"};
  EXPECT_EQ(NamedBy({"img_0", "img_1", "img_2"}, PosesCalled(from_one)).names, from_one);
}

TEST(PoseFrames, NumbersThatBothListsLackAreNamed) {
  const Names poses = {"pose_1", "pose_2", "pose_4"};
  const Named named = NamedBy({"img_1", "img_3", "img_4"}, PosesCalled(poses));
  EXPECT_EQ(named.names, poses);
  EXPECT_THAT(named.message,
              AllOf(HasSubstr("'pose_2'"), HasSubstr("'img_3'"), HasSubstr("use the same names")));
}

TEST(PoseFrames, RowsWithoutFramesAreInTheOrderOfTheImages) {
  const Named all = NamedBy({"img10", "img8", "img9"}, Rows(3));
  EXPECT_THAT(all.names, ElementsAre("img8", "img9", "img10"));
  EXPECT_THAT(all.message, HasSubstr("have no frames"));
  EXPECT_THAT(NamedBy({"b", "a"}, Rows(2)).names, ElementsAre("a", "b"));
}

TEST(PoseFrames, AsManyRowsAsImagesAreRefusedIfTheImagesNumbersHaveGaps) {
  const Named named = NamedBy({"img1", "img2", "img4", "img5"}, Rows(4));
  EXPECT_EQ(named.names, NamesOf(Rows(4)));
  EXPECT_THAT(named.message, AllOf(HasSubstr("missing between 'img1' and 'img5'"),
                                   HasSubstr("put the frame first")));
}

TEST(PoseFrames, RowsOfImagesWithoutABoardAreSkippedByTheNumbersOfTheOthers) {
  EXPECT_THAT(NamedBy({"img1", "img4"}, Rows(4)).names,
              ElementsAre("img1", NameOfRow(2), NameOfRow(3), "img4"));
  EXPECT_THAT(NamedBy({"img0", "img3"}, Rows(4)).names,
              ElementsAre("img0", NameOfRow(2), NameOfRow(3), "img3"));
}

TEST(PoseFrames, MoreRowsThanImagesCountedFromZeroAreRefused) {
  const Named named = NamedBy({"img0", "img2"}, Rows(4));
  EXPECT_EQ(named.names, NamesOf(Rows(4)));
  EXPECT_THAT(named.message, HasSubstr("put the frame first"));
}

TEST(PoseFrames, RowsThatCannotBeAssignedAreRefusedWithTheMend) {
  EXPECT_THAT(NamedBy({"img1", "img3"}, Rows(4)).message,
              AllOf(HasSubstr("4 robot poses without frames"), HasSubstr("put the frame first")));
  EXPECT_THAT(NamedBy({"a", "b"}, Rows(3)).message, HasSubstr("put the frame first"));
}

}  // namespace
}  // namespace silhouette
