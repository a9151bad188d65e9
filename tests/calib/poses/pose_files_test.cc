// SPDX-License-Identifier: Apache-2.0
// The files of robot poses and surveys: what is wrong in them is told with file and line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "calib/poses/pose_files.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr char kHeader[] = "frame,tx,ty,tz,qx,qy,qz,qw\n";

std::string PoseMistake(const std::string& rows) {
  return std::string(RobotPosesFromText(kHeader + rows, "poses.csv").status().message());
}

TEST(RobotPoseFile, ReadsBackWhatItWrote) {
  RobotPose pose{.frame = "a, \"b\""};
  pose.base_from_flange.translation() = Eigen::Vector3d(0.1, -0.2, 1.0 / 3);
  pose.base_from_flange.linear() =
      Eigen::AngleAxisd(2.1, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
  const auto poses = RobotPosesFromText(RobotPoseFileText({pose, {.frame = "c"}}), "poses.csv");
  ASSERT_TRUE(poses.ok()) << poses.status();
  ASSERT_EQ(poses->size(), 2u);
  EXPECT_EQ((*poses)[0].frame, pose.frame);
  EXPECT_TRUE((*poses)[0].base_from_flange.isApprox(pose.base_from_flange, 1e-14));
}

TEST(RobotPoseFile, MistakesAreToldWithTheirLine) {
  EXPECT_THAT(PoseMistake("a,0,0,0,0,0,0,1\na,0,0,1,0,0,0,1\n"),
              AllOf(HasSubstr("poses.csv:3"), HasSubstr("'a' is there already")));
  EXPECT_THAT(PoseMistake("a,0,0,0,0,0,0,0.7\n"),
              AllOf(HasSubstr("poses.csv:2"), HasSubstr("length is 0.7")));
  EXPECT_THAT(PoseMistake("a,400,0,900,0,0,0,1\n"), HasSubstr("millimetres"));
  EXPECT_THAT(PoseMistake("a,x,0,0,0,0,0,1\n"), HasSubstr("poses.csv:2"));
  EXPECT_THAT(PoseMistake(",0,0,0,0,0,0,1\n"), HasSubstr("no name"));
}

TEST(SurveyFile, ReadsPosesAndSigmas) {
  const auto boards = SurveyFromText(
      "- board: floor\n  position: [0.4, -0.2, 0]\n  rotation: [180 deg, 0, 90 deg]\n"
      "  position_sigma: 0.002\n  rotation_sigma: 1 deg\n"
      "- {board: wall, position: [1, 0, 0], quaternion: [0, 0, 0, 1]}\n",
      "survey.yaml");
  ASSERT_TRUE(boards.ok()) << boards.status();
  ASSERT_EQ(boards->size(), 2u);
  EXPECT_TRUE((boards->front().base_from_board * Eigen::Vector3d::UnitX())
                  .isApprox(Eigen::Vector3d(0.4, 0.8, 0)));
  EXPECT_DOUBLE_EQ(boards->front().position_sigma, 0.002);
  EXPECT_NEAR(boards->front().rotation_sigma, 0.01745, 1e-5);
}

TEST(SurveyFile, MistakesAreToldWithTheirLine) {
  const auto mistake = [](const std::string& text) {
    return std::string(SurveyFromText(text, "survey.yaml").status().message());
  };
  EXPECT_THAT(mistake("- {board: a, position: [0, 0, 0]}\n- {board: a, position: [0, 0, 0]}\n"),
              AllOf(HasSubstr("survey.yaml:2"), HasSubstr("twice")));
  EXPECT_THAT(mistake("- {board: a, position: [0, 0, 0], quaternion: [0, 0, 0, 2]}\n"),
              HasSubstr("length 1"));
  EXPECT_THAT(mistake("- {board: a, position: [400, 0, 900]}\n"), HasSubstr("millimetres"));
  EXPECT_THAT(mistake("- {board: a, position: [0, 0, 0], position_sigma: 0}\n"),
              HasSubstr("positive"));
  EXPECT_THAT(mistake("- {board: a, positon: [0, 0, 0]}\n"), HasSubstr("position"));
}

}  // namespace
}  // namespace silhouette
