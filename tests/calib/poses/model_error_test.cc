// SPDX-License-Identifier: Apache-2.0
// Print, paper and lens are not quite as described: good poses of the robot are kept, and what is
// called certain is. Whatever sigma is stated of the corners, the verdict is the same.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <utility>

#include "calib/poses/pose_calibration.h"
#include "tests/calib/poses/pose_rig.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

// Detection is good to 0.01 px; the print to 0.3 mm, which is 0.15 px, and the lens to 0.3 px.
PoseRig MisfitRig(unsigned seed, int cameras = 3, int frames = 24) {
  PoseRig rig(seed, cameras);
  rig.corner_sigma = 0.01;
  rig.print_sigma = 0.3e-3;
  rig.true_distortion = {-0.122, 0.034, 0.0006, -0.0002};
  rig.AddFlangeBoard();
  rig.Drive(frames);
  return rig;
}

PoseProblem WithSigma(PoseProblem problem, double sigma) {
  for (TagSighting& seen : problem.sightings) seen.sigma = sigma;
  return problem;
}

// The frames whose pose of the robot was left out, and those that lost a tag.
std::pair<std::set<std::string>, std::set<std::string>> LeftOut(const PoseSolution& solution) {
  std::set<std::string> poses;
  std::set<std::string> tags;
  for (const SolvedFrame& frame : solution.frames) {
    if (frame.robot_outlier) poses.insert(frame.name);
    if (frame.outliers > 0) tags.insert(frame.name);
  }
  return {poses, tags};
}

TEST(ModelError, GoodPosesOfTheRobotAreKept) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    for (const int cameras : {1, 3}) {
      const PoseRig rig = MisfitRig(seed, cameras);
      const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
      ASSERT_TRUE(solution.ok()) << solution.status();
      EXPECT_THAT(LeftOut(*solution).first, testing::IsEmpty()) << seed << ", " << cameras;
      for (const SolvedNoise& noise : solution->noise) {
        EXPECT_GT(noise.sigma, 4 * noise.stated) << noise.view;
      }
    }
  }
}

TEST(ModelError, NoTagIsCutToThreeCorners) {
  PoseRig rig = MisfitRig(5);
  for (size_t i = 3; i < rig.problem.sightings.size(); i += 7) {
    rig.problem.sightings[i].corners[i % 4].y() += 5;
  }
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_FALSE(LeftOut(*solution).second.empty());
  for (const SolvedFrame& frame : solution->frames) EXPECT_EQ(frame.outliers % 4, 0) << frame.name;
}

TEST(ModelError, TheVerdictIsTheSameForAnyStatedSigma) {
  for (unsigned seed = 11; seed <= 12; ++seed) {
    PoseRig rig = MisfitRig(seed);
    const std::string wrong = rig.problem.sightings[rig.problem.sightings.size() / 2].frame;
    for (RobotPose& pose : rig.problem.robot_poses) {
      if (pose.frame == wrong) pose.base_from_flange.translation().x() += 0.015;
    }
    const absl::StatusOr<PoseSolution> first = CalibratePoses(WithSigma(rig.problem, 0.005));
    ASSERT_TRUE(first.ok()) << first.status();
    EXPECT_THAT(LeftOut(*first).first, testing::ElementsAre(wrong));
    for (const double sigma : {0.05, 0.5}) {
      const absl::StatusOr<PoseSolution> other = CalibratePoses(WithSigma(rig.problem, sigma));
      ASSERT_TRUE(other.ok()) << other.status();
      EXPECT_EQ(LeftOut(*first), LeftOut(*other)) << sigma;
      for (size_t i = 0; i < first->views.size(); ++i) {
        EXPECT_LT(PoseError(other->views[i].camera_pose, first->views[i].camera_pose).norm(), 1e-6);
        EXPECT_TRUE(other->views[i].covariance.isApprox(first->views[i].covariance, 1e-3));
      }
    }
  }
}

TEST(ModelError, ARefusalIsTheSameForAnyStatedSigma) {
  PoseRig rig = MisfitRig(21);
  std::vector<RobotPose> poses = rig.problem.robot_poses;
  for (size_t i = 0; i < poses.size(); ++i) {
    rig.problem.robot_poses[i].base_from_flange =
        poses[(7 * i + 5) % poses.size()].base_from_flange;
  }
  for (const double sigma : {0.005, 0.5}) {
    EXPECT_THAT(std::string(CalibratePoses(WithSigma(rig.problem, sigma)).status().message()),
                HasSubstr("contradict"));
  }
}

// A tag whose two poses are hardly told apart: the robot tells which.
TEST(ModelError, TheOtherPoseOfAPlaneIsTriedBeforeTheRobotIsDoubted) {
  for (unsigned seed = 31; seed <= 32; ++seed) {
    PoseRig rig(seed, 1);
    rig.corner_sigma = 0.1;
    rig.print_sigma = 0.2e-3;
    rig.AddFlangeBoard(0.05);
    const Eigen::Vector3d at = rig.camera_poses[0].inverse().translation();
    for (int i = 0; i < 24; ++i) {
      rig.Take("frame" + std::to_string(100 + i), rig.RandomFlange(at, 15 * kRigDegree));
    }
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(WithSigma(rig.problem, 0.01));
    ASSERT_TRUE(solution.ok()) << solution.status();
    EXPECT_THAT(LeftOut(*solution).first, testing::IsEmpty()) << seed;
  }
}

// Frames whose flange turns about z only; of the last ones also about x.
PoseRig TurnedRig(int frames, int about_two_axes) {
  PoseRig rig(41, 1);
  rig.AddFlangeBoard();
  for (int i = 0; i < frames; ++i) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() =
        Eigen::AngleAxisd(rig.Uniform(-3, 3), Eigen::Vector3d::UnitZ()).toRotationMatrix();
    if (i >= frames - about_two_axes) {
      pose.linear() =
          pose.linear() * Eigen::AngleAxisd(rig.Uniform(0.3, 0.5), Eigen::Vector3d::UnitX());
    }
    pose.translation() =
        Eigen::Vector3d(rig.Uniform(-0.2, 0.2), rig.Uniform(-0.2, 0.2), rig.Uniform(0.3, 0.5));
    rig.Take("frame" + std::to_string(100 + i), pose);
  }
  return rig;
}

TEST(WeakPoses, FourFramesOfOneTagAreRefusedWithHowManyMoreWouldDo) {
  PoseRig rig = FlangeRig(7, 1, 5);
  while (rig.problem.sightings.size() > 4) rig.problem.sightings.pop_back();
  ASSERT_EQ(rig.problem.sightings.size(), 4u);
  const absl::Status status = CalibratePoses(rig.problem).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()),
              testing::AllOf(HasSubstr("only 4 poses"),
                             HasSubstr("'silhouette-calibrate poses --least-frames'"),
                             HasSubstr("add 2 or more")));
}

TEST(WeakPoses, PosesThatOneFrameDecidesAreRefused) {
  EXPECT_THAT(Refusal(TurnedRig(9, 1).problem), HasSubstr("without the frame 'frame108'"));
  EXPECT_THAT(Refusal(TurnedRig(14, 1).problem), HasSubstr("without the frame 'frame113'"));
  const absl::StatusOr<PoseSolution> enough = CalibratePoses(TurnedRig(11, 6).problem);
  EXPECT_TRUE(enough.ok()) << enough.status();
}

TEST(WeakPoses, AViewThatSawTheBoardOnceIsRefusedHoweverLongTheSession) {
  PoseRig rig = FlangeRig(7, 4, 30);
  std::string once;
  std::erase_if(rig.problem.sightings, [&](const TagSighting& seen) {
    if (seen.view != "camera3") return false;
    const bool first = once.empty();
    if (first) once = seen.frame;
    return !first;
  });
  EXPECT_THAT(Refusal(rig.problem),
              HasSubstr("without the frame '" + once + "' the pose of view 'camera3' is not"));
}

TEST(WeakPoses, ASurveyNeedsNoRobot) {
  PoseRig rig(12);
  rig.AddFloorTags();
  rig.Take("one", Eigen::Isometry3d::Identity());
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
  EXPECT_TRUE(solution.ok()) << solution.status();
}

}  // namespace
}  // namespace silhouette
