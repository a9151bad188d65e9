// SPDX-License-Identifier: Apache-2.0
// How exact camera poses are, over several seeds, and whether they are as exact as they say.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "calib/poses/pose_calibration.h"
#include "common/numbers/numbers.h"
#include "tests/calib/poses/pose_rig.h"
#include "tests/random.h"

namespace silhouette {
namespace {

struct Errors {
  std::vector<double> centre;     // of the camera, metres
  std::vector<double> rotation;   // radians
  std::vector<double> workspace;  // root mean square over points of the workspace, metres
  std::vector<double> chi2;       // of six errors by the predicted covariance, a pose each

  std::vector<double> chi2_per_dof;  // of each solution

  void Add(const PoseRig& rig, const PoseSolution& solution) {
    chi2_per_dof.push_back(solution.chi2_per_dof);
    for (size_t i = 0; i < solution.views.size(); ++i) {
      EXPECT_EQ(solution.views[i].on_flange, rig.problem.views[i].on_flange);
      const Eigen::Isometry3d& solved = solution.views[i].camera_pose;
      const Eigen::Isometry3d& truth = rig.camera_poses[i];
      centre.push_back((solved.inverse().translation() - truth.inverse().translation()).norm());
      const auto error = PoseError(solved, truth);
      rotation.push_back(error.head<3>().norm());
      double sum = 0;
      int points = 0;
      for (const double x : {-0.75, 0.0, 0.75}) {
        for (const double y : {-0.75, 0.0, 0.75}) {
          for (const double z : {0.0, 0.75, 1.5}) {
            const Eigen::Vector3d point(x, y, z);
            sum += (solved * point - truth * point).squaredNorm();
            ++points;
          }
        }
      }
      workspace.push_back(std::sqrt(sum / points));
      chi2.push_back(error.dot(solution.views[i].covariance.ldlt().solve(error)));
    }
  }
};

double Worst(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}
double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

void Print(const std::string& what, const Errors& errors) {
  std::cout << what << ": centre " << 1000 * Median(errors.centre) << " (worst "
            << 1000 * Worst(errors.centre) << ") mm, " << Median(errors.rotation) / kRigDegree
            << " (worst " << Worst(errors.rotation) / kRigDegree << ") deg, workspace "
            << 1000 * Median(errors.workspace) << " (worst " << 1000 * Worst(errors.workspace)
            << ") mm, chi2 " << Mean(errors.chi2) / 6 << '\n';
}

// Of the solutions of the rigs that `make` makes of the seeds 1, 2, ...
template <typename Make>
Errors ErrorsOf(int seeds, const Make& make) {
  Errors errors;
  for (unsigned seed = 1; seed <= static_cast<unsigned>(SampleCount(seeds)); ++seed) {
    const PoseRig rig = make(seed);
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
    EXPECT_TRUE(solution.ok()) << "seed " << seed << ": " << solution.status();
    if (!solution.ok()) continue;
    errors.Add(rig, *solution);
  }
  return errors;
}

TEST(PoseAccuracy, ThirtyPosesOfATagOnTheFlange) {
  const Errors modelled = ErrorsOf(10, [](unsigned seed) { return FlangeRig(seed); });
  const Errors exact = ErrorsOf(10, [](unsigned seed) {
    PoseRig rig = FlangeRig(seed);
    rig.problem.robot_exact = true;
    return rig;
  });
  for (const double chi2_per_dof : modelled.chi2_per_dof) EXPECT_NEAR(chi2_per_dof, 1, 0.2);
  Print("30 poses, robot noise modelled", modelled);
  Print("30 poses, robot taken at its word", exact);
  EXPECT_LT(Median(modelled.centre), 0.85e-3);
  EXPECT_LT(Median(modelled.rotation), 0.022 * kRigDegree);
  EXPECT_LT(Worst(modelled.workspace), 1e-3);
  // Its errors are then in the frames' corners, and the uncertainty counts them so.
  EXPECT_LT(Mean(exact.chi2) / 6, 2);
  if (SampleCount(10) < 10) return;  // one rig tells nothing of the errors' spread
  EXPECT_LT(Median(modelled.workspace), 0.4e-3);
  EXPECT_GT(Mean(modelled.chi2) / 6, 0.8);
  EXPECT_LT(Mean(modelled.chi2) / 6, 1.25);
  EXPECT_GT(Median(exact.workspace), 1.1 * Median(modelled.workspace));
}

// As by blur: the corners of an image are shifted together.
TEST(PoseAccuracy, ErrorsThatCornersOfAnImageShareMakePosesAsUncertainAsTheyAre) {
  const Errors errors = ErrorsOf(20, [](unsigned seed) {
    PoseRig rig(seed);
    rig.AddFlangeBoard();
    rig.Drive(30);
    std::map<std::pair<std::string, std::string>, Eigen::Vector2d> blurs;
    for (TagSighting& seen : rig.problem.sightings) {
      const auto [blur, first] = blurs.try_emplace({seen.frame, seen.view});
      if (first) blur->second = {rig.Normal(0.2), rig.Normal(0.2)};
      for (Eigen::Vector2d& corner : seen.corners) corner += blur->second;
    }
    return rig;
  });
  Print("30 poses, blurred images", errors);
  EXPECT_LT(Mean(errors.chi2) / 6, 1.4);
  if (SampleCount(20) < 20) return;  // by chance the errors of one rig can be smaller
  EXPECT_GT(Mean(errors.chi2) / 6, 0.7);
}

TEST(PoseAccuracy, FramesAtOnePoseOfTheRobotShareItsError) {
  PoseRig rig(5);
  rig.AddFlangeBoard();
  rig.Drive(8);
  rig.problem.least_frames = 6;
  const auto once = CalibratePoses(rig.problem);
  ASSERT_TRUE(once.ok()) << once.status();
  const RobotPose last = rig.problem.robot_poses.back();
  std::vector<TagSighting> seen = rig.problem.sightings;
  std::erase_if(seen, [&](const TagSighting& tag) { return tag.frame != last.frame; });
  for (int i = 0; i < 40; ++i) {
    const std::string frame = "rest" + std::to_string(i);
    rig.problem.robot_poses.push_back({frame, last.base_from_flange});
    for (TagSighting tag : seen) {
      tag.frame = frame;
      for (Eigen::Vector2d& corner : tag.corners) {
        corner += Eigen::Vector2d(rig.Normal(0.05), rig.Normal(0.05));
      }
      rig.problem.sightings.push_back(tag);
    }
  }
  const auto often = CalibratePoses(rig.problem);
  ASSERT_TRUE(often.ok()) << often.status();
  EXPECT_THAT(often->warnings, testing::Contains(testing::HasSubstr("only 8 poses of the robot")));
  for (size_t view = 0; view < once->views.size(); ++view) {
    EXPECT_GT(often->views[view].workspace_sigma, 0.8 * once->views[view].workspace_sigma) << view;
  }
}

// A view saw its board only in two of three frames above: here in each of thirty.
TEST(PoseAccuracy, ThirtySightingsByOneView) {
  const Errors errors = ErrorsOf(10, [](unsigned seed) {
    PoseRig rig(seed, 1);
    rig.AddFlangeBoard();
    const Eigen::Vector3d at = rig.camera_poses[0].inverse().translation();
    for (int i = 0; rig.problem.sightings.size() < 30; ++i) {
      rig.Take("frame" + std::to_string(i), rig.RandomFlange(at));
    }
    return rig;
  });
  Print("30 sightings", errors);
  EXPECT_LT(Median(errors.centre), 0.85e-3);
  EXPECT_LT(Median(errors.rotation), 0.022 * kRigDegree);
  EXPECT_LT(Median(errors.workspace), 0.4e-3);
  EXPECT_LT(Worst(errors.workspace), 0.8e-3);
}

TEST(PoseAccuracy, CameraOnTheFlange) {
  const Errors errors = ErrorsOf(6, [](unsigned seed) {
    PoseRig rig(seed, 0);
    Eigen::Isometry3d camera_from_flange = Eigen::Isometry3d::Identity();
    camera_from_flange.linear() =
        Eigen::AngleAxisd(0.2, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
    camera_from_flange.translation() = Eigen::Vector3d(0.03, -0.06, -0.05);
    rig.Add("hand", camera_from_flange, true);
    Eigen::Isometry3d standing = Eigen::Isometry3d::Identity();
    standing.linear() = Eigen::AngleAxisd(3.1, Eigen::Vector3d::UnitX()).matrix();
    standing.translation() = Eigen::Vector3d(-0.2, 0.3, 0.01);
    rig.AddBoard("table", BoardPlace::kStanding, standing, 0.07, 2, 2);
    rig.Drive(25);
    return rig;
  });
  Print("camera on the flange", errors);
  EXPECT_LT(Median(errors.centre), 0.4e-3);
  EXPECT_LT(Median(errors.rotation), 0.022 * kRigDegree);
  EXPECT_GT(Mean(errors.chi2) / 6, 0.6);
  EXPECT_LT(Mean(errors.chi2) / 6, 1.5);
}

// Two views never see the flange; they are tied by boards that were held into the cell.
TEST(PoseAccuracy, BoardsSeenTogetherTieViewsThatDoNotSeeTheFlange) {
  const Errors errors = ErrorsOf(4, [](unsigned seed) { return HeldBoardRig(seed, 15); });
  Print("two views by shared boards", errors);
  EXPECT_LT(Median(errors.workspace), 0.5e-3);
  EXPECT_GT(Mean(errors.chi2) / 6, 0.5);
  EXPECT_LT(Mean(errors.chi2) / 6, 1.6);
}

TEST(PoseAccuracy, SurveyedTagsPutViewsInTheBase) {
  const Errors errors = ErrorsOf(10, [](unsigned seed) {
    PoseRig rig(seed);
    rig.AddFloorTags();
    for (int i = 0; i < 3; ++i)
      rig.Take("frame" + std::to_string(i), Eigen::Isometry3d::Identity());
    return rig;
  });
  Print("five tags surveyed to 1 mm", errors);
  EXPECT_LT(Median(errors.workspace), 2e-3);
  EXPECT_LT(Mean(errors.chi2) / 6, 1.4);
  if (SampleCount(10) < 10) return;  // by chance the errors of one rig can be smaller
  EXPECT_GT(Mean(errors.chi2) / 6, 0.7);
}

}  // namespace
}  // namespace silhouette
