// SPDX-License-Identifier: Apache-2.0
// What is wrong in the data is told, and never becomes a confident wrong pose.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/poses/pose_bundle.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_fit.h"
#include "calib/poses/pose_frames.h"
#include "tests/calib/poses/pose_rig.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> Warnings(const PoseProblem& problem) {
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(problem);
  EXPECT_TRUE(solution.ok()) << solution.status();
  return solution.ok() ? solution->warnings : std::vector<std::string>();
}

TEST(PoseRefusals, GoodDataAreTakenWithoutAWord) {
  EXPECT_THAT(Warnings(FlangeRig(7, 4, 18).problem), testing::IsEmpty());
}

TEST(PoseRefusals, TwoPosesAreTooFew) {
  PoseRig rig(1, 1);
  rig.AddFlangeBoard();
  const Eigen::Vector3d at = rig.camera_poses[0].inverse().translation();
  for (int i = 0; rig.problem.sightings.size() < 2; ++i) {
    rig.Take("frame" + std::to_string(i), rig.RandomFlange(at));
  }
  EXPECT_THAT(Refusal(rig.problem), AllOf(HasSubstr("camera0"), HasSubstr("three with different")));
}

TEST(PoseRefusals, TurningAboutOneAxisOnlyDoesNotDetermineThePosition) {
  PoseRig rig(2, 2);
  rig.AddFlangeBoard();
  for (int i = 0; i < 20; ++i) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(rig.Uniform(-3, 3), Eigen::Vector3d::UnitZ()).matrix();
    pose.translation() =
        Eigen::Vector3d(rig.Uniform(-0.4, 0.4), rig.Uniform(-0.4, 0.4), rig.Uniform(0.3, 0.9));
    rig.Take("frame" + std::to_string(i), pose);
  }
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("about one axis only"));
}

TEST(PoseRefusals, LooseBoardsAloneHaveNoBase) {
  PoseRig rig(3);
  rig.AddBoard("held", BoardPlace::kLoose, Eigen::Isometry3d::Identity(), 0.05, 3, 3);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitX()).matrix();
  pose.translation().z() = 0.6;
  for (int i = 0; i < 5; ++i) rig.See("held" + std::to_string(i), 0, pose);
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("nothing says where the robot's base is"));
}

TEST(PoseRefusals, AFlangeBoardThatNoViewSawIsNamed) {
  PoseRig rig = FlangeRig(7, 4, 18);
  rig.AddBoard("held", BoardPlace::kLoose, Eigen::Isometry3d::Identity(), 0.05, 3, 3);
  rig.problem.sightings.clear();
  rig.Hold(rig.problem.boards.size() - 1, 5);
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("no fixed view saw the flange's board 'flange'"));
}

TEST(PoseRefusals, UnconnectedViewsAreNamed) {
  PoseRig rig = FlangeRig(7, 4, 18);
  rig.AddBoard("held", BoardPlace::kLoose, Eigen::Isometry3d::Identity(), 0.05, 3, 3);
  std::erase_if(rig.problem.sightings,
                [](const TagSighting& seen) { return seen.view == "camera2"; });
  EXPECT_THAT(Refusal(rig.problem), AllOf(HasSubstr("'camera2'"), Not(HasSubstr("'camera1'"))));
  TagSighting lonely = rig.problem.sightings.front();
  lonely.view = "camera2";
  lonely.frame = "held";
  lonely.tag = 1;
  rig.problem.sightings.push_back(lonely);
  EXPECT_THAT(Refusal(rig.problem),
              AllOf(HasSubstr("'camera2' is not connected"), Not(HasSubstr("'camera1'"))));
}

TEST(PoseRefusals, AWrongTagSizeIsToldByTheRobotsMotion) {
  for (const double said : {0.1, 0.118, 0.18}) {
    PoseRig rig = FlangeRig(7, 4, 18);
    BoardDescription board = rig.problem.boards[0].board.description();
    board.tag_size = said;
    rig.problem.boards[0].board = Board(board);
    EXPECT_THAT(Refusal(rig.problem),
                AllOf(HasSubstr("measure 120"), HasSubstr("mm (+- 0."), HasSubstr("mm), not 1"),
                      HasSubstr("mm elsewhere"),
                      HasSubstr("'silhouette-calibrate poses --trust-size found' takes them so"),
                      HasSubstr("'--trust-size stated' keeps")))
        << said;
  }
}

TEST(PoseRefusals, WhatCountsOfAWrongTagSizeCanBeStated) {
  for (const double said : {0.1, 0.118}) {
    PoseRig rig = FlangeRig(7, 4, 18);
    BoardDescription board = rig.problem.boards[0].board.description();
    board.tag_size = said;
    rig.problem.boards[0].board = Board(board);
    rig.problem.size_trust = SizeTrust::kFound;
    const absl::StatusOr<PoseSolution> found = CalibratePoses(rig.problem);
    ASSERT_TRUE(found.ok()) << found.status();
    EXPECT_THAT(found->warnings,
                Contains(AllOf(HasSubstr("measure 1"), HasSubstr("--trust-size found"))));
    EXPECT_NEAR(found->boards[0].size * said, 0.12, 1e-4);
    EXPECT_LT(PoseError(found->views[0].camera_pose, rig.camera_poses[0]).tail<3>().norm(), 3e-3);
  }
  for (const double said : {0.108, 0.1164, 0.118, 0.132}) {
    PoseRig rig = FlangeRig(7, 4, 18);
    BoardDescription board = rig.problem.boards[0].board.description();
    board.tag_size = said;
    rig.problem.boards[0].board = Board(board);
    rig.problem.size_trust = SizeTrust::kStated;
    EXPECT_THAT(Warnings(rig.problem),
                Contains(AllOf(HasSubstr("measure 12"), HasSubstr(" mm (+- "),
                               HasSubstr("mm elsewhere, not as they are"))))
        << said << Refusal(rig.problem);
  }
}

TEST(PoseRefusals, ATagThatIsALittleLargerIsMentionedAndItsSizeFound) {
  PoseRig rig = FlangeRig(7, 4, 18);
  BoardDescription board = rig.problem.boards[0].board.description();
  board.tag_size *= 0.995;
  rig.problem.boards[0].board = Board(board);
  EXPECT_THAT(Warnings(rig.problem),
              Contains(AllOf(HasSubstr("measure 120 mm (+- 0."), HasSubstr("mm), not 119.4 mm"))));
  const absl::StatusOr<PoseSolution> found = CalibratePoses(rig.problem);
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_NEAR(found->boards[0].size * 0.995, 1, 1e-3);
  rig.problem.size_trust = SizeTrust::kStated;
  const absl::StatusOr<PoseSolution> stated = CalibratePoses(rig.problem);
  ASSERT_TRUE(stated.ok()) << stated.status();
  EXPECT_EQ(stated->boards[0].size, 1);
}

// The wrist alone turns: a camera that is farther away sees a larger tag just so.
TEST(PoseRefusals, ASizeThatTheMotionDoesNotCheckIsRefusedUnlessItIsVouchedFor) {
  PoseRig rig(7, 1);
  rig.AddFlangeBoard();
  const Eigen::Vector3d at = rig.camera_poses[0].inverse().translation();
  for (int i = 0; i < 20; ++i) {
    Eigen::Isometry3d flange = rig.RandomFlange(at);
    flange.translation() = Eigen::Vector3d(0, 0, 0.7);
    rig.Take("frame" + std::to_string(100 + i), flange);
  }
  BoardDescription board = rig.problem.boards[0].board.description();
  board.tag_size /= 1.03;
  rig.problem.boards[0].board = Board(board);
  const auto unchecked = HasSubstr("determines the size of board 'flange' (+- ");
  EXPECT_THAT(Refusal(rig.problem),
              AllOf(unchecked, HasSubstr("by 20 cm and more"),
                    HasSubstr("'silhouette-calibrate poses --trust-size stated'"),
                    HasSubstr("--accept-doubts")));
  rig.problem.size_trust = SizeTrust::kStated;
  EXPECT_THAT(Warnings(rig.problem), Contains(unchecked));
  rig.problem.size_trust = SizeTrust::kNeither;
  rig.problem.accept_doubts = true;
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_THAT(solution->doubts, Contains(unchecked));
  EXPECT_GT(PoseError(solution->views[0].camera_pose, rig.camera_poses[0]).tail<3>().norm(), 0.05)
      << "which is why";
}

TEST(PoseRefusals, PosesShiftedByOneFrameAreTold) {
  for (const int by : {1, -1}) {
    PoseRig rig = FlangeRig(7, 4, 18);
    std::vector<RobotPose> poses = rig.problem.robot_poses;
    const int count = static_cast<int>(poses.size());
    for (int i = 0; i < count; ++i) {
      rig.problem.robot_poses[i].base_from_flange =
          poses[(i + by + count) % count].base_from_flange;
    }
    EXPECT_THAT(Refusal(rig.problem),
                AllOf(HasSubstr("shifted by one"), HasSubstr(by == 1 ? "before it" : "after it")));
  }
}

TEST(PoseRefusals, PosesInReverseOrderAreTold) {
  for (const int frames : {17, 18}) {
    PoseRig rig = FlangeRig(7, 4, frames);
    const std::vector<RobotPose> poses = rig.problem.robot_poses;
    for (size_t i = 0; i < poses.size(); ++i) {
      rig.problem.robot_poses[i].base_from_flange = poses[poses.size() - 1 - i].base_from_flange;
    }
    EXPECT_THAT(Refusal(rig.problem), HasSubstr("in the reverse order")) << frames;
  }
}

TEST(PoseRefusals, OneViewWhoseImagesAreShiftedIsNamed) {
  PoseRig rig = FlangeRig(7, 4, 18);
  for (TagSighting& seen : rig.problem.sightings) {
    if (seen.view == "camera1") {
      seen.frame = "frame" + std::to_string(std::stoi(seen.frame.substr(5)) + 1);
    }
  }
  EXPECT_THAT(Refusal(rig.problem), AllOf(HasSubstr("'camera1'"), HasSubstr("shifted by one")));
}

TEST(PoseRefusals, MillimetresAreTold) {
  PoseRig rig = FlangeRig(7, 4, 18);
  for (RobotPose& pose : rig.problem.robot_poses) pose.base_from_flange.translation() *= 1000;
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("millimetres"));
}

TEST(PoseRefusals, InvertedPosesAreTold) {
  PoseRig rig = FlangeRig(7, 4, 18);
  for (RobotPose& pose : rig.problem.robot_poses) {
    pose.base_from_flange = pose.base_from_flange.inverse();
  }
  EXPECT_THAT(Refusal(rig.problem), AllOf(HasSubstr("inverted"), HasSubstr("--eye-in-hand")));
}

TEST(PoseRefusals, ListsThatWereSortedDifferentlyAreTold) {
  for (const bool people : {true, false}) {
    PoseRig rig = FlangeRig(7, 1, 18);
    // frame1000 is img1, and frame1010 is img11.
    const auto rename = [](std::string& frame) {
      frame = "img" + std::to_string(std::stoi(frame.substr(5)) - 999);
    };
    for (TagSighting& seen : rig.problem.sightings) rename(seen.frame);
    for (RobotPose& pose : rig.problem.robot_poses) rename(pose.frame);
    rig.problem.robot_poses = SortedOtherwise(rig.problem.robot_poses, people);
    EXPECT_THAT(Refusal(rig.problem), HasSubstr("were sorted differently")) << people;
  }
}

TEST(PoseRefusals, SizesOfTheLastSolveAreHeldToTheSameLimit) {
  const PoseRig rig = FlangeRig(7, 1, 18);
  absl::StatusOr<PoseFit> fit = FitWithExactRobot(rig.problem);
  ASSERT_TRUE(fit.ok()) << fit.status();
  const auto refusal = [&](double size, double sigma, SizeTrust trust) {
    fit->bundle.sizes.assign(fit->bundle.sizes.size(), 1);
    fit->bundle.size_sigmas.assign(fit->bundle.sizes.size(), 0);
    fit->bundle.sizes[0] = size;
    fit->bundle.size_sigmas[0] = sigma;
    return std::string(CheckFinalSizes(trust, *fit).message());
  };
  EXPECT_THAT(
      refusal(1.02, 1e-4, SizeTrust::kNeither),
      AllOf(HasSubstr("measure 122.4 mm (+- 0.012 mm), not 120 mm"), HasSubstr("--trust-size")));
  EXPECT_THAT(refusal(0.98, 1e-4, SizeTrust::kNeither), HasSubstr("measure 117.6 mm"));
  EXPECT_EQ(refusal(1.009, 1e-4, SizeTrust::kNeither), "");
  EXPECT_EQ(refusal(1.02, 0.01, SizeTrust::kNeither), "") << "that may be chance";
  EXPECT_EQ(refusal(1.02, 1e-4, SizeTrust::kFound), "");
  EXPECT_EQ(refusal(1.02, 1e-4, SizeTrust::kStated), "");
}

TEST(PoseRefusals, BoardsNameTheirSquaresOrSpacingsWithTheUncertainty) {
  const PoseRig rig = FlangeRig(7, 1, 18);
  absl::StatusOr<PoseFit> fit = FitWithExactRobot(rig.problem);
  ASSERT_TRUE(fit.ok()) << fit.status();
  fit->bundle.sizes.assign(fit->bundle.sizes.size(), 1.02);
  fit->bundle.size_sigmas.assign(fit->bundle.sizes.size(), 1e-4);
  BoardDescription d = {.name = "b", .rows = 6, .columns = 9, .square = 0.025};
  for (const auto& [kind, lengths] : {std::pair{BoardKind::kChessboard, "squares"},
                                      {BoardKind::kCharuco, "squares"},
                                      {BoardKind::kCircles, "spacings"}}) {
    d.kind = kind;
    d.tag_size = kind == BoardKind::kCharuco ? 0.018 : 0;
    fit->network.boards[0].board = Board(d);
    EXPECT_THAT(std::string(CheckFinalSizes(SizeTrust::kNeither, *fit).message()),
                HasSubstr(absl::StrCat("the ", lengths,
                                       " of board 'b' measure 25.5 mm (+- 0.0025 mm), not 25 mm")));
  }
}

TEST(PoseRefusals, PosesWhoseUncertaintyCannotBeFoundAreRefused) {
  const PoseRig rig = FlangeRig(7, 1, 18);
  absl::StatusOr<PoseFit> fit = FitWithExactRobot(rig.problem);
  ASSERT_TRUE(fit.ok()) << fit.status();
  EXPECT_TRUE(CountCommonErrors(fit->bundle).ok());
  // One frame: the camera may be anywhere, with the board on the flange.
  const int flange = fit->bundle.corners.front().flange;
  std::erase_if(fit->bundle.corners,
                [&](const BundleCorner& corner) { return corner.flange != flange; });
  EXPECT_THAT(std::string(CountCommonErrors(fit->bundle).status().message()),
              HasSubstr("cannot be found, as the data hardly determine them"));
}

TEST(PoseRefusals, QuaternionsWithWInFrontAreTold) {
  PoseRig rig = FlangeRig(7, 4, 18);
  for (RobotPose& pose : rig.problem.robot_poses) {
    const Eigen::Quaterniond q(pose.base_from_flange.linear());
    pose.base_from_flange.linear() = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()).matrix();
  }
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("w, x, y, z"));
}

TEST(PoseRefusals, MirroredImagesAreTold) {
  PoseRig rig = FlangeRig(7, 4, 18);
  for (TagSighting& seen : rig.problem.sightings) {
    if (seen.view != "camera3") continue;
    for (Eigen::Vector2d& corner : seen.corners) corner.x() = 1279 - corner.x();
  }
  EXPECT_THAT(Refusal(rig.problem), AllOf(HasSubstr("'camera3'"), HasSubstr("mirrored")));
}

TEST(PoseRefusals, ABoardWhoseColumnsAreMirroredIsTold) {
  PoseRig rig(5);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(3.0, Eigen::Vector3d::UnitX()).matrix();
  rig.AddBoard("plate", BoardPlace::kFlange, pose, 0.05, 2, 3);
  rig.Drive(20);
  for (TagSighting& seen : rig.problem.sightings) seen.tag += 2 - 2 * (seen.tag % 3);
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("a board is mirrored"));
}

TEST(PoseRefusals, DataThatNothingExplainsAreRefused) {
  PoseRig rig = FlangeRig(7, 4, 18);
  std::vector<RobotPose> poses = rig.problem.robot_poses;
  for (size_t i = 0; i < poses.size(); ++i) {
    rig.problem.robot_poses[i].base_from_flange =
        poses[(7 * i + 5) % poses.size()].base_from_flange;
  }
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("contradict"));
}

TEST(PoseRefusals, ATagWithABadCornerIsLeftOutAsAWholeAndABadPoseToo) {
  PoseRig rig = FlangeRig(7, 4, 18);
  rig.problem.sightings[5].corners[2].x() += 4;
  rig.problem.robot_poses[9].base_from_flange.translation().x() += 0.01;
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_THAT(solution->warnings,
              Contains(HasSubstr("'" + rig.problem.sightings[5].frame + "' (4)")));
  EXPECT_THAT(solution->warnings, Contains(AllOf(HasSubstr("the robot stood elsewhere"),
                                                 HasSubstr(rig.problem.robot_poses[9].frame))));
  for (size_t i = 0; i < solution->views.size(); ++i) {
    EXPECT_LT(PoseError(solution->views[i].camera_pose, rig.camera_poses[i]).tail<3>().norm(),
              2e-3);
  }
}

TEST(PoseRefusals, ARobotLessExactThanStatedIsToldAndReckonedWith) {
  PoseRig rig(11);
  rig.AddFlangeBoard();
  rig.problem.robot_noise = {.position_sigma = 0.8e-3, .rotation_sigma = 0.08 * kRigDegree};
  rig.Drive(30);
  rig.problem.robot_noise = {};
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_NEAR(solution->robot_noise_factor, 4, 0.8);
  EXPECT_THAT(solution->warnings, Contains(HasSubstr("--robot-sigma")));
}

TEST(PoseRefusals, ASurveyedPlaceThatIsWrongIsLeftOutAndNamed) {
  PoseRig rig(12);
  rig.AddFloorTags();
  rig.Take("one", Eigen::Isometry3d::Identity());
  rig.problem.boards[2].base_from_board.translation().x() += 0.05;
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_THAT(solution->warnings,
              Contains(AllOf(HasSubstr("boards stand elsewhere"), HasSubstr("'floor2'"))));
  for (size_t i = 0; i < solution->views.size(); ++i) {
    EXPECT_LT(PoseError(solution->views[i].camera_pose, rig.camera_poses[i]).tail<3>().norm(),
              8e-3);
  }
}

TEST(PoseRefusals, ASurveyInAnotherFrameThanTheRobotsIsRefused) {
  PoseRig rig(13);
  rig.AddFloorTags();
  rig.AddFlangeBoard();
  rig.Drive(20);
  EXPECT_EQ(Refusal(rig.problem), "");
  for (PoseBoard& board : rig.problem.boards) board.base_from_board.translation().y() += 0.05;
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("the survey contradicts"));
}

TEST(PoseRefusals, TheSameImageTwiceIsTold) {
  PoseRig rig = FlangeRig(7, 4, 18);
  for (size_t i = 0; i < rig.problem.sightings.size(); ++i) {
    TagSighting copy = rig.problem.sightings[i];
    if (copy.frame != "frame1004") continue;
    copy.frame = "frame1099";
    rig.problem.sightings.push_back(copy);
  }
  rig.problem.robot_poses.push_back({"frame1099", rig.problem.robot_poses[5].base_from_flange});
  EXPECT_THAT(Refusal(rig.problem),
              AllOf(HasSubstr("same image"), HasSubstr("frame1004"), HasSubstr("frame1099")));
}

TEST(PoseRefusals, FramesWithoutAPoseOfTheRobotAreNamed) {
  PoseRig rig = FlangeRig(7, 4, 18);
  const std::string frame = rig.problem.robot_poses[4].frame;
  rig.problem.robot_poses.erase(rig.problem.robot_poses.begin() + 4);
  EXPECT_THAT(Warnings(rig.problem), Contains(HasSubstr(frame)));
  for (RobotPose& pose : rig.problem.robot_poses) pose.frame = "image" + pose.frame;
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("no frame has a pose of the robot"));
  rig.problem.robot_poses.clear();
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("give the robot's poses"));
}

TEST(PoseRefusals, NamesTwiceAreMistakes) {
  PoseRig rig = FlangeRig(7, 4, 18);
  const auto refused = [&](auto change, const std::string& says) {
    PoseProblem problem = rig.problem;
    change(problem);
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(problem);
    EXPECT_EQ(solution.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(solution.status().message()), HasSubstr(says));
  };
  refused([](auto& p) { p.sightings.push_back(p.sightings[0]); }, "twice");
  refused([](auto& p) { p.robot_poses.push_back(p.robot_poses[0]); }, "two poses");
  refused([](auto& p) { p.views.push_back(p.views[0]); }, "twice");
  refused([](auto& p) { p.boards.push_back(p.boards[0]); }, "twice");
  refused([](auto& p) { p.sightings[0].view = "nobody"; }, "'nobody'");
  refused([](auto& p) { p.sightings[0].sigma = 0; }, "sigma");
}

}  // namespace
}  // namespace silhouette
