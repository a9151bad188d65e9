// SPDX-License-Identifier: Apache-2.0
// The files of robot poses and surveys: what is wrong in them is told with file and line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "calib/poses/pose_files.h"
#include "calib/poses/pose_frames.h"
#include "calib/poses/pose_notation.h"
#include "calib/poses/pose_problem.h"

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

RobotPose OnlyPose(const std::string& text, const std::string& notation,
                   const std::string& units = "") {
  const auto poses =
      RobotPosesFromText(text, "poses", PoseNotation::Named(notation, units).value());
  EXPECT_TRUE(poses.ok()) << notation << ": " << poses.status();
  return poses.ok() && poses->size() == 1 ? poses->front() : RobotPose{};
}

// Columns of the rotation matrices as textbooks write them, for angles of 200, 40 and 50 degrees.
TEST(RobotPoseFile, RobotsConventionsAreTheirMakers) {
  const auto sine = [](double degrees) { return std::sin(degrees * kDegree); };
  const auto cosine = [](double degrees) { return std::cos(degrees * kDegree); };
  const Eigen::Vector3d position(0.4, -0.1, 0.6);

  const RobotPose kuka = OnlyPose("frame,X,Y,Z,A,B,C\na,400,-100,600,200,40,50\n", "kuka");
  const Eigen::Vector3d kuka_x(cosine(200) * cosine(40), sine(200) * cosine(40), -sine(40));
  EXPECT_TRUE(kuka.base_from_flange.translation().isApprox(position));
  EXPECT_TRUE(kuka.base_from_flange.linear().col(0).isApprox(kuka_x));
  EXPECT_NEAR(kuka.base_from_flange(2, 2), cosine(40) * cosine(50), 1e-12);

  const RobotPose fanuc = OnlyPose("a 400 -100 600 50 40 200\n", "fanuc");
  EXPECT_TRUE(fanuc.base_from_flange.isApprox(kuka.base_from_flange));
  const RobotPose rpy =
      OnlyPose("frame;x;y;z;roll;pitch;yaw\na;40;-10;60;50;40;200\n", "rpy", "cm,deg");
  EXPECT_TRUE(rpy.base_from_flange.isApprox(kuka.base_from_flange));

  const RobotPose staubli = OnlyPose("a\t400\t-100\t600\t200\t40\t50\n", "staubli");
  const Eigen::Vector3d staubli_z(sine(40), -sine(200) * cosine(40), cosine(200) * cosine(40));
  EXPECT_TRUE(staubli.base_from_flange.linear().col(2).isApprox(staubli_z));
  EXPECT_NEAR(staubli.base_from_flange(0, 0), cosine(40) * cosine(50), 1e-12);

  // A third of a turn about (1, 1, 1) takes x to y, y to z and z to x.
  Eigen::Isometry3d third = Eigen::Isometry3d::Identity();
  third.linear() << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  third.translation() = position;
  const std::vector<std::pair<std::string, std::string>> texts = {
      {"ur", "a, 0.4, -0.1, 0.6, 1.2091995761561452, 1.2091995761561452, 1.2091995761561452"},
      {"abb", "frame,x,y,z,q1,q2,q3,q4\na,400,-100,600,0.5,0.5,0.5,0.5\n"},
      {"abb", "frame,q4,q3,q2,q1,x,y,z\na,0.5,0.5,0.5,0.5,400,-100,600\n"},
      {"tum", "# timestamp tx ty tz qx qy qz qw\na 0.4 -0.1 0.6 0.5 0.5 0.5 0.5\n"}};
  for (const auto& [notation, text] : texts) {
    EXPECT_TRUE(OnlyPose(text, notation).base_from_flange.isApprox(third)) << notation;
  }
  EXPECT_TRUE(OnlyPose("a 0 0 1 400 1 0 0 -100 0 1 0 600 0 0 0 1\n", "matrix", "mm")
                  .base_from_flange.isApprox(third));
  EXPECT_TRUE(OnlyPose("a 0 0 1 400 1 0 0 -100 0 1 0 600\n", "matrix", "mm")
                  .base_from_flange.isApprox(third));
}

TEST(RobotPoseFile, JsonAndOneFilePerFrameAreRead) {
  const RobotPose matrix = OnlyPose(
      R"({"0007": [[0, -1, 0, 0.4], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]})", "matrix", "m");
  EXPECT_EQ(matrix.frame, "0007");
  EXPECT_TRUE(matrix.base_from_flange.linear().col(0).isApprox(Eigen::Vector3d::UnitY()));
  const RobotPose named =
      OnlyPose(R"([{"frame": 7, "tx": 0.4, "ty": 0, "tz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}])",
               "quaternion");
  EXPECT_EQ(named.frame, "7");
  EXPECT_EQ(named.base_from_flange.translation().x(), 0.4);
  const auto files = RobotPosesFromTexts(
      {{"1", "1.txt", "[[0 -1 0 400]\n[1 0 0 0]\n[0 0 1 0]\n[0 0 0 1]]"}, {"2", "2.txt", "1 2"}},
      PoseNotation::Named("matrix", "mm").value());
  EXPECT_EQ(files.status().message(), "2.txt: a pose as 'matrix' is 16 or 12 numbers, not 2");
}

TEST(RobotPoseFile, AFrameThatIsTwiceInJsonIsRefused) {
  const std::string pose = "[0.4, 0, 0, 0, 0, 0, 1]";
  const std::string text = R"({"0007": )" + pose + R"(, "0008": )" + pose + R"(, "0007": )" + pose;
  EXPECT_EQ(RobotPosesFromText(text + "}", "poses.json").status().message(),
            "poses.json: '0007' is there twice; leave one");
}

TEST(RobotPoseFile, TablesAreReadAsPeopleWriteThem) {
  const RobotPose expected =
      OnlyPose("frame,tx,ty,tz,qx,qy,qz,qw\na,0.4,-0.1,0.6,0.6,0,0,0.8\n", "quaternion");
  ASSERT_NE(expected.base_from_flange.translation().x(), 0);
  for (const char* const text :
       {"\xEF\xBB\xBFimage,x,y,z,qw,qx,qy,qz\r\na,0.4,-0.1,0.6,0.8,0.6,0,0\r\n",
        "% poses\n// of the arm\n# by hand\na 0.4 -0.1 0.6 0.6 0 0 0.8\n",
        "Timestamp;pos_x;pos_y;pos_z;q_x;q_y;q_z;q_w\na;0,4;-0,1;0,6;0,6;0;0;0,8\n",
        "a\t0,4\t-0,1\t0,6\t0,6\t0\t0\t0,8\n", "- [a, 0.4, -0.1, 0.6, 0.6, 0, 0, 0.8]\n",
        "- a, 0.4, -0.1, 0.6, 0.6, 0, 0, 0.8\n", "(a, 0.4, -0.1, 0.6, 0.6, 0, 0, 0.8)\n",
        "a, {0.4, -0.1, 0.6}, {0.6, 0, 0, 0.8}\n"}) {
    const RobotPose pose = OnlyPose(text, "quaternion");
    EXPECT_EQ(pose.frame, "a") << text;
    EXPECT_TRUE(pose.base_from_flange.isApprox(expected.base_from_flange, 1e-12)) << text;
  }
}

TEST(RobotPoseFile, PosesAreReadInTheRobotsOwnSyntax) {
  const std::string six = "X 400, Y -100, Z 600, A 0, B 0, C 73.73979529168804";
  const std::string axes = "[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]";
  struct Form {
    std::string notation;
    std::string text;
    std::string frame = NameOfRow(1);
  };
  const RobotPose expected = OnlyPose("a,0.4,-0.1,0.6,0.6,0,0,0.8\n", "quaternion");
  for (const Form& form :
       {Form{"kuka", "{" + six + "}\n"}, Form{"kuka", "a {" + six + "}\n", "a"},
        Form{"kuka", "{E6POS: " + six + ", S 2, T 35, E1 0, E2 0, E3 0, E4 0, E5 0, E6 0}\n"},
        Form{"kuka", "DEFDAT points\nDECL E6POS XP1={" + six + ",S 2,T 35,E1 0.0}\nENDDAT\n",
             "XP1"},
        Form{"fanuc",
             "/POS\nP[7]{\n   GP1:\n\tUF : 0, UT : 1,\tCONFIG : 'N U T, 0, 0, 0',\n"
             "\tX = 400.0  mm,\tY = -100.0  mm,\tZ = 600.0  mm,\n"
             "\tW = 73.73979529168804 deg,\tP = 0.0 deg,\tR = 0.0 deg\n};\n/END\n",
             "7"},
        Form{"abb", "[[400,-100,600],[0.8,0.6,0,0]," + axes + "]\n"},
        Form{"abb", "CONST robtarget p10:=[[400,-100,600],[0.8,0.6,0,0]," + axes + "];\n", "p10"},
        Form{"ur", "p[0.4, -0.1, 0.6, 1.2870022175866, 0, 0]\n"},
        Form{"ur", "a = p[0.4, -0.1, 0.6, 1.2870022175866, 0, 0]\n", "a"},
        Form{"quaternion", R"([{"position": {"x": 0.4, "y": -0.1, "z": 0.6},
              "orientation": {"x": 0.6, "y": 0, "z": 0, "w": 0.8}}])"},
        Form{"tum", R"({"a": {"position": {"x": 0.4, "y": -0.1, "z": 0.6},
              "orientation": {"x": 0.6, "y": 0, "z": 0, "w": 0.8}}})",
             "a"}}) {
    const RobotPose pose = OnlyPose(form.text, form.notation);
    EXPECT_EQ(pose.frame, form.frame) << form.text;
    EXPECT_TRUE(pose.base_from_flange.isApprox(expected.base_from_flange, 1e-9)) << form.text;
  }
}

TEST(RobotPoseFile, ARecordWithoutAllNumbersIsRefused) {
  const std::string whole = "{X 400, Y -100, Z 600, A 0, B 0, C 70}\n";
  const PoseNotation kuka = PoseNotation::Named("kuka", "").value();
  for (const std::string part :
       {"{X 400, Y -100, Z 600, A 0, B 0}\n", "{A1 0, A2 -90, A3 90}\n",
        "{X 400, Y -100, Z 600, A 0, B 0, C 70, C 71}\n",
        "{X 400,5, Y -100, Z 600, A 0, B 0, C 70}\n", "{X 400, Y -100, Z 600, A 0, B 0, C 7"}) {
    EXPECT_FALSE(RobotPosesFromText(whole + part, "poses", kuka).ok()) << part;
  }
  EXPECT_FALSE(RobotPosesFromText("p[0.4, -0.1, 0.6, 0, 0]\n", "poses",
                                  PoseNotation::Named("ur", "").value())
                   .ok());
  EXPECT_THAT(std::string(RobotPosesFromText("\x93NUMPY\1", "poses.npy").status().message()),
              HasSubstr("numpy.savetxt("));
}

TEST(RobotPoseFile, NamesMayHaveBracketsAndDashes) {
  for (const std::string name : {"img (1).png", "run - 3"}) {
    EXPECT_EQ(OnlyPose(kHeader + name + ",0.4,-0.1,0.6,0.6,0,0,0.8\n", "quaternion").frame, name);
  }
}

TEST(RobotPoseFile, ASignApartFromItsNumberIsRefused) {
  const std::string mend = ": a '-' stands apart; write it with its number";
  for (const std::string row :
       {"a 0.4 - 0.1 0.6 0.6 0 0 0.8", "- 0.4 0.1 0.6 0.6 0 0 0.8", "a 0.4 0.1 0.6 0 0 0 - 1",
        "- 7 0.4 0.1 0.6 0.6 0 0 0.8", "a\t0,4\t- 0,1\t0,6\t0,6\t0\t0\t0,8",
        "[0.4, - 0.1, 0.6], 0.6, 0, 0, 0.8", "- [a, 0.4, - 0.1, 0.6, 0.6, 0, 0, 0.8]",
        "- - 0.4 0.1 0.6 0.6 0 0 0.8", "a -[0.4, 0.1, 0.6], 0.6, 0, 0, 0.8"}) {
    const auto poses = RobotPosesFromText("# poses\n" + row + "\n", "poses");
    EXPECT_EQ(poses.status().message(), "poses:2" + mend) << row;
  }
  EXPECT_THAT(PoseMistake("a, 0.4, - 0.1, 0.6, 0.6, 0, 0, 0.8"),
              HasSubstr("poses.csv:2: ' - 0.1' is not a finite number"));
  const PoseNotation matrix = PoseNotation::Named("matrix", "mm").value();
  const std::string lines = "1 0 0 100\n0 1 0 - 200\n0 0 1 300\n0 0 0 1\n";
  EXPECT_EQ(RobotPosesFromText(lines, "poses", matrix).status().message(), "poses:2" + mend);
  EXPECT_EQ(RobotPosesFromTexts({{"1", "1.txt", lines}}, matrix).status().message(),
            "1.txt: '-' is not a finite number");
}

TEST(RobotPoseFile, AListMarkOnSomeLinesOnlyIsRefused) {
  const std::string row = "[a, 0.4, -0.1, 0.6, 0.6, 0, 0, 0.8]\n";
  EXPECT_FALSE(RobotPosesFromText("- " + row + "b, 0.4, -0.1, 0.6, 0.6, 0, 0, 0.8\n", "p").ok());
  const auto file = RobotPosesFromTexts({{"1", "1.txt",
                                          "- [1, 0, 0, 100]\n- [0, 1, 0, 0]\n"
                                          "- [0, 0, 1, 300]\n- [0, 0, 0, 1]\n"}},
                                        PoseNotation::Named("matrix", "mm").value());
  EXPECT_TRUE(file.ok()) << file.status();
}

TEST(RobotPoseFile, FourMatricesOfThreeLinesAreNotThreeOfFour) {
  std::string text;
  for (const std::string x : {"100", "200", "300", "1"}) {
    text += "1 0 0 " + x + "\n0 1 0 0\n0 0 1 400\n";
  }
  const auto poses =
      RobotPosesFromText(text, "poses.txt", PoseNotation::Named("matrix", "mm").value());
  ASSERT_TRUE(poses.ok()) << poses.status();
  ASSERT_EQ(poses->size(), 4u);
  EXPECT_NEAR((*poses)[1].base_from_flange.translation().x(), 0.2, 1e-12);
  EXPECT_NEAR((*poses)[3].base_from_flange.translation().x(), 1e-3, 1e-12);
}

TEST(RobotPoseFile, MatricesOfFourLinesMayBeginAtOne) {
  const std::string last = "0.0 0.0 0.0 1.0\n";
  const std::string text = "1 0 0 1.0\n0 1 0 0\n0 0 1 400\n" + last +
                           "1 0 0 2\n0 1 0 0\n0 0 1 500\n" + last +
                           "1 0 0 3\n0 1 0 0\n0 0 1 600\n" + last;
  const auto poses =
      RobotPosesFromText(text, "poses.txt", PoseNotation::Named("matrix", "mm").value());
  ASSERT_TRUE(poses.ok()) << poses.status();
  ASSERT_EQ(poses->size(), 3u);
  EXPECT_NEAR((*poses)[0].base_from_flange.translation().x(), 1e-3, 1e-12);
  EXPECT_NEAR((*poses)[2].base_from_flange.translation().z(), 0.6, 1e-12);
}

TEST(RobotPoseFile, MatricesMayBeOverSeveralLines) {
  const PoseNotation notation = PoseNotation::Named("matrix", "mm").value();
  const std::string first = "0 -1 0 400\n1 0 0 0\n0 0 1 0\n";
  const std::string second = "1 0 0 100\n0 1 0 0\n0 0 1 300\n";
  const std::string last = "0 0 0 1\n";
  for (const std::string& text :
       {first + last + second + last, first + last + "\n" + second + last + "\n",
        "2\n\n" + first + last + "\n" + second + last, first + second,
        std::string("[[[0, -1, 0, 400], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],"
                    "[[1, 0, 0, 100], [0, 1, 0, 0], [0, 0, 1, 300], [0, 0, 0, 1]]]")}) {
    const auto poses = RobotPosesFromText(text, "poses.txt", notation);
    ASSERT_TRUE(poses.ok()) << poses.status() << text;
    ASSERT_EQ(poses->size(), 2u) << text;
    EXPECT_EQ((*poses)[1].frame, NameOfRow(2));
    EXPECT_NEAR((*poses)[0].base_from_flange(1, 0), 1, 1e-12);
    EXPECT_NEAR((*poses)[1].base_from_flange.translation().z(), 0.3, 1e-12);
  }
  const auto named =
      RobotPosesFromText("a\n" + first + last + "b\n" + second + last, "p", notation);
  ASSERT_TRUE(named.ok()) << named.status();
  EXPECT_EQ((*named)[1].frame, "b");
}

TEST(RobotPoseFile, ListsAreReadAsPythonAndNumpyPrintThem) {
  const PoseNotation matrix = PoseNotation::Named("matrix", "m").value();
  for (const char* const text :
       {"[[[ 0.   -1.    0.    0.4 ]\n  [ 1.    0.    0.    0.  ]\n  [ 0.    0.    1.    0.  ]\n"
        "  [ 0.    0.    0.    1.  ]]\n\n [[ 1.    0.    0.    0.1 ]\n  [ 0.    1.    0.    0.  ]\n"
        "  [ 0.    0.    1.    0.3 ]\n  [ 0.    0.    0.    1.  ]]]\n",
        "[array([[0., -1., 0., 0.4],\n       [1., 0., 0., 0.],\n       [0., 0., 1., 0.],\n"
        "       [0., 0., 0., 1.]]), array([[1., 0., 0., 0.1],\n       [0., 1., 0., 0.],\n"
        "       [0., 0., 1., 0.3],\n       [0., 0., 0., 1.]])]",
        "array([[[0., -1., 0., 0.4], [1., 0., 0., 0.], [0., 0., 1., 0.], [0., 0., 0., 1.]],\n"
        " [[1., 0., 0., 0.1], [0., 1., 0., 0.], [0., 0., 1., 0.3], [0., 0., 0., 1.]]])",
        "[((0, -1, 0, 0.4), (1, 0, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),\n"
        " ((1, 0, 0, 0.1), (0, 1, 0, 0), (0, 0, 1, 0.3), (0, 0, 0, 1)),]"}) {
    const auto poses = RobotPosesFromText(text, "poses.txt", matrix);
    ASSERT_TRUE(poses.ok()) << poses.status() << text;
    ASSERT_EQ(poses->size(), 2u) << text;
    EXPECT_EQ((*poses)[1].frame, NameOfRow(2));
    EXPECT_NEAR((*poses)[0].base_from_flange(1, 0), 1, 1e-12);
    EXPECT_NEAR((*poses)[1].base_from_flange.translation().z(), 0.3, 1e-12);
  }
  // A row over two lines, as numpy breaks long ones.
  const RobotPose broken = OnlyPose("[[ 0.4 -0.1  0.6  0.6\n   0.   0.   0.8]]", "quaternion");
  EXPECT_NEAR(broken.base_from_flange.translation().y(), -0.1, 1e-12);
  EXPECT_TRUE(RobotPosesFromTexts({{"1", "1.txt",
                                    "array([[1., 0., 0., 0.1],\n       [0., 1., 0., 0. ],\n"
                                    "       [0., 0., 1., 0.3],\n       [0., 0., 0., 1. ]])\n"}},
                                  matrix)
                  .ok());
}

TEST(RobotPoseFile, CommentsInListsTakeNoPoseAndAListThatIsCutOffIsRefused) {
  const std::string row = "[0.4, -0.1, 0.6, 0.6, 0, 0, 0.8]";
  const auto poses = RobotPosesFromText("[" + row + ",\n " + row + ",  # was it blurred [?]\n " +
                                            row + ",\n# the last\n " + row + "]",
                                        "poses.txt", PoseNotation());
  ASSERT_TRUE(poses.ok()) << poses.status();
  EXPECT_EQ(poses->size(), 4u);
  EXPECT_TRUE(
      RobotPosesFromText("np.array([" + row + "], dtype=float32)", "p", PoseNotation()).ok());
  EXPECT_THAT(std::string(RobotPosesFromText("[" + row + ",\n [0.4, -0.1, 0.6, 0.6, 0, 0, 0.8",
                                             "poses.txt", PoseNotation())
                              .status()
                              .message()),
              HasSubstr("poses.txt: the list is cut off"));
}

TEST(RobotPoseFile, WhatNumpyLeavesOutInPrintIsRefusedWithTheMend) {
  const std::string row = "[1. 0. 0. 0.1]\n  [0. 1. 0. 0.]\n  [0. 0. 1. 0.3]\n  [0. 0. 0. 1.]";
  for (const auto& [notation, text] :
       {std::pair<std::string, std::string>{"matrix", "[[" + row + "]\n ...\n [" + row + "]]"},
        {"quaternion", "[[0.4 0.1 0.6 ... 0. 0. 1.]\n [0.4 0.1 0.6 ... 0. 0. 1.]]"},
        {"quaternion", "[[0.4 0.1 0.6 0. 0. 0. 1.]\n ...\n [0.4 0.1 0.6 0. 0. 0. 1.]]"},
        {"quaternion", "[[np.float64(0.4), np.float64(0.1)]]"}}) {
    const std::string units = notation == "matrix" ? "m" : "";
    EXPECT_THAT(
        std::string(RobotPosesFromText(text, "p", PoseNotation::Named(notation, units).value())
                        .status()
                        .message()),
        AllOf(HasSubstr("p: no poses as '" + notation + "'"), HasSubstr("numpy.savetxt(FILE")));
  }
}

TEST(RobotPoseFile, UnitsAreStatedOrRefusedAndNeverGuessed) {
  const auto unnamed = [](const std::string& notation, const std::string& units = "") {
    return std::string(PoseNotation::Named(notation, units).status().message());
  };
  EXPECT_THAT(unnamed("rotation_vector"), HasSubstr("no units of their own; state them"));
  EXPECT_THAT(unnamed("matrix"), HasSubstr("e.g. mm"));
  EXPECT_THAT(unnamed("kuka", "inch,deg"), HasSubstr("are no units of poses as 'kuka'"));
  EXPECT_THAT(unnamed("abb", "mm,deg"), HasSubstr("are no units of poses as 'abb'"));
  EXPECT_THAT(unnamed("kawasaki"), HasSubstr("known are quaternion, tum"));

  const auto mistake = [](const std::string& text, const std::string& notation,
                          const std::string& units = "") {
    return std::string(
        RobotPosesFromText(text, "poses", PoseNotation::Named(notation, units).value())
            .status()
            .message());
  };
  EXPECT_THAT(mistake("a 0.4 0.1 0.6 90 0 0\n", "kuka"), HasSubstr("positions are in metres"));
  EXPECT_THAT(mistake("a 400 100 600 1.5 0 0\n", "kuka"), HasSubstr("angles are in radians"));
  EXPECT_EQ(mistake("a 400 100 600 1.5 0 0\n", "kuka", "mm,deg"), "");
  EXPECT_THAT(mistake("a 0.4 0.1 0.6 90 0 0\n", "ur"), HasSubstr("angles are in degrees"));
  EXPECT_THAT(mistake("a 0.4 0.1 0.6 90 0 0\n", "rpy", "m,rad"),
              HasSubstr("angles are in degrees"));
  EXPECT_THAT(mistake("a 400 100 600 1.5 0 0\n", "ur"),
              AllOf(HasSubstr("poses:1"), HasSubstr("millimetres")));
  EXPECT_THAT(mistake("a 0 0 1 400 1 0 0 -100 0 2 0 600 0 0 0 1\n", "matrix", "mm"),
              HasSubstr("no rotation"));
  EXPECT_THAT(mistake("a 0 0 1 0 1 0 0 0 0 1 0 0 400 -100 600 1\n", "matrix", "mm"),
              HasSubstr("last row"));
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
