// SPDX-License-Identifier: Apache-2.0
// Lenses that are not as described, and cameras and boards that move during a session: refused, and
// named with the frame. Good sessions are not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <string>

#include "calib/poses/pose_calibration.h"
#include "tests/calib/poses/pose_rig.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// `change` is called before the frame `at` of 30.
PoseRig ChangingRig(unsigned seed, int cameras, int at, const std::function<void(PoseRig&)>& change,
                    double print_sigma = 0) {
  PoseRig rig(seed, cameras);
  rig.print_sigma = print_sigma;
  rig.AddFlangeBoard();
  for (int i = 0; i < 30; ++i) {
    if (i == at) change(rig);
    rig.Take("frame" + std::to_string(100 + i),
             rig.RandomFlange({rig.Uniform(-1, 1), rig.Uniform(-1, 1), 2.5}));
  }
  return rig;
}

// The camera's centre moves along its image.
std::function<void(PoseRig&)> PushedCamera(size_t camera, double metres) {
  return [=](PoseRig& rig) {
    rig.camera_poses[camera] = Eigen::Translation3d(metres, 0, 0) * rig.camera_poses[camera];
  };
}

TEST(PoseMisfits, ALensWithoutItsDistortionIsRefused) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    for (const int cameras : {1, 3}) {
      PoseRig rig = FlangeRig(seed, cameras);
      rig.problem.views[0].lens.distortion = {};
      EXPECT_THAT(Refusal(rig.problem),
                  AllOf(HasSubstr("lens model of view 'camera0' does not fit (it states no dist"),
                        HasSubstr("intrinsics"), Not(HasSubstr("moved"))))
          << seed << ", " << cameras;
    }
  }
}

TEST(PoseMisfits, WhatALensThatIsOffCostsIsInThePredictedError) {
  double squares = 0;
  int count = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    PoseRig rig = FlangeRig(seed, 3);
    for (PoseView& view : rig.problem.views) view.lens.distortion[0] *= 0.8;
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
    ASSERT_TRUE(solution.ok()) << solution.status();
    EXPECT_THAT(solution->warnings, Contains(HasSubstr("does not fit"))) << seed;
    for (size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d centre(0, 0, 0.75);
      const SolvedView& view = solution->views[i];
      const double off = (view.camera_pose * centre - rig.camera_poses[i] * centre).norm();
      squares += std::pow(off / PointSigma(view.covariance, centre), 2);
      ++count;
    }
  }
  EXPECT_LT(squares / count, 2);
}

// The frame is the first in which the camera saw a board, or a neighbour of it.
TEST(PoseMisfits, ACameraThatMovedIsRefusedWithItsNameAndFrame) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    for (const int at : {10, 15}) {
      const std::string refusal = Refusal(ChangingRig(seed, 3, at, PushedCamera(1, 3e-3)).problem);
      EXPECT_THAT(refusal, HasSubstr("view 'camera1' moved")) << seed << ", " << at;
      int frame = 0;
      double millimetres = 0;
      const size_t from = refusal.find("from the frame 'frame");
      ASSERT_NE(from, std::string::npos) << refusal;
      ASSERT_EQ(
          std::sscanf(refusal.c_str() + from, "from the frame 'frame%d' on it is elsewhere, by %lf",
                      &frame, &millimetres),
          2);
      EXPECT_GE(frame, 100 + at - 1) << seed;
      EXPECT_LE(frame, 100 + at + 3) << seed;
      EXPECT_NEAR(millimetres, 3, 2) << seed;
    }
  }
}

TEST(PoseMisfits, ACameraThatMovedIsFoundWithoutOthers) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const PoseRig rig = ChangingRig(seed, 1, 15, PushedCamera(0, 4e-3));
    EXPECT_THAT(Refusal(rig.problem), HasSubstr("view 'camera0'")) << seed;
  }
}

TEST(PoseMisfits, ABoardThatSlippedIsRefusedWithItsName) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const PoseRig rig = ChangingRig(seed, 3, 12, [](PoseRig& slips) {
      slips.board_poses[0].translate(Eigen::Vector3d(3e-3, 0, 0));
    });
    EXPECT_THAT(Refusal(rig.problem), AllOf(HasSubstr("the board 'flange' moved"),
                                            HasSubstr("'frame112'"), Not(HasSubstr("camera"))))
        << seed;
  }
}

TEST(PoseMisfits, DoubtsCanBeAccepted) {
  PoseRig rig = ChangingRig(1, 3, 15, PushedCamera(1, 3e-3));
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("--accept-doubts"));
  rig.problem.accept_doubts = true;
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
  ASSERT_TRUE(solution.ok()) << solution.status();
  ASSERT_EQ(solution->doubts.size(), 1u);
  EXPECT_THAT(solution->warnings, Contains(solution->doubts[0]));
}

// Accepted, the doubt is a warning.
TEST(PoseMisfits, TheDoubtOfALensSaysThatMotionsAreNotLookedFor) {
  PoseRig rig = FlangeRig(1, 3);
  rig.problem.views[0].lens.distortion = {};
  EXPECT_THAT(Refusal(rig.problem),
              AllOf(HasSubstr("lens model of view 'camera0' does not fit"),
                    HasSubstr("motions of cameras and boards during the session are not looked")));
}

// Points all over what camera0 of a rig sees, one metre before it.
std::vector<Eigen::Vector3d> PointsBefore(const PoseRig& rig) {
  const CameraModel camera(rig.problem.views[0].lens, rig.camera_poses[0]);
  std::vector<Eigen::Vector3d> points;
  for (int x = 10; x < 1280; x += 20) {
    for (int y = 10; y < 960; y += 20) {
      points.push_back(camera.Centre() + *camera.Ray(Eigen::Vector2d(x, y)));
    }
  }
  return points;
}

// All of an image of 1280 x 960 but a strip of this width, pixels, on the left.
LensRegion WithoutStrip(double width) {
  return {.contour = {{width, -1}, {1281, -1}, {1281, 961}, {width, 961}, {width, -1}},
          .sigma = 1.9};
}

TEST(UnknownLens, IsRefusedWithWhereItShowsTheWorkspace) {
  PoseRig rig(4, 2);
  rig.AddFlangeBoard();
  rig.Drive(14);
  rig.problem.workspace = PointsBefore(rig);
  ASSERT_TRUE(CalibratePoses(rig.problem).ok()) << "a lens of which nothing is said";
  rig.problem.views[0].known = WithoutStrip(-1);
  ASSERT_TRUE(CalibratePoses(rig.problem).ok());
  rig.problem.views[0].known = WithoutStrip(140);
  EXPECT_THAT(Refusal(rig.problem),
              AllOf(HasSubstr("view 'camera0': the lens is not known"),
                    HasSubstr("10.9 % of the robot's workspace (top left, left, bottom left of"),
                    HasSubstr("--accept-doubts")));
  rig.problem.views[0].known = LensRegion{.contour{}, .sigma = 1.9};
  EXPECT_THAT(Refusal(rig.problem), HasSubstr("100 % of the robot's workspace"));
  rig.problem.workspace.clear();
  EXPECT_TRUE(CalibratePoses(rig.problem).ok()) << "it is not known where the robot works";
}

TEST(UnknownLens, ByAnotherProgramsRegionIsWarnedOf) {
  PoseRig rig(4, 2);
  rig.AddFlangeBoard();
  rig.Drive(14);
  rig.problem.workspace = PointsBefore(rig);
  rig.problem.views[0].known = WithoutStrip(140);
  rig.problem.views[0].known->sigma.reset();
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_THAT(solution->warnings, Contains(HasSubstr("view 'camera0': the lens is not known")));
  EXPECT_THAT(solution->doubts, IsEmpty());
}

// Prints off by 0.2 mm, and lenses by 0.3 px at the rim.
TEST(PoseMisfits, GoodSessionsAreNotDoubted) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    for (const int cameras : {1, 3}) {
      PoseRig rig(seed, cameras);
      rig.print_sigma = 0.2e-3;
      rig.true_distortion = {-0.122, 0.034, 0.0006, -0.0002};
      rig.AddFlangeBoard();
      rig.Drive(24);
      const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
      ASSERT_TRUE(solution.ok()) << solution.status();
      EXPECT_THAT(solution->warnings, Not(Contains(HasSubstr("moved: ")))) << seed;
    }
  }
}

}  // namespace
}  // namespace silhouette
