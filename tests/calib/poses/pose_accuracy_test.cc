// SPDX-License-Identifier: Apache-2.0
// How exact camera poses are, over several seeds, and whether they are as exact as they say.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "calib/poses/pose_calibration.h"
#include "tests/calib/poses/pose_rig.h"

namespace silhouette {
namespace {

struct Errors {
  std::vector<double> centre;     // of the camera, metres
  std::vector<double> rotation;   // radians
  std::vector<double> workspace;  // root mean square over points of the workspace, metres
  std::vector<double> chi2;       // of six errors by the predicted covariance, a pose each

  void Add(const PoseRig& rig, const PoseSolution& solution) {
    for (size_t i = 0; i < solution.views.size(); ++i) {
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

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}
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

TEST(PoseAccuracy, ThirtyPosesOfATagOnTheFlange) {
  Errors modelled;
  Errors exact;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    PoseRig rig(seed);
    rig.AddFlangeBoard();
    rig.Drive(30);
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
    ASSERT_TRUE(solution.ok()) << "seed " << seed << ": " << solution.status();
    modelled.Add(rig, *solution);
    EXPECT_NEAR(solution->chi2_per_dof, 1, 0.2) << "seed " << seed;
    rig.problem.robot_exact = true;
    const absl::StatusOr<PoseSolution> naive = CalibratePoses(rig.problem);
    ASSERT_TRUE(naive.ok()) << "seed " << seed << ": " << naive.status();
    exact.Add(rig, *naive);
  }
  Print("30 poses, robot noise modelled", modelled);
  Print("30 poses, robot taken at its word", exact);
  EXPECT_LT(Median(modelled.centre), 0.85e-3);
  EXPECT_LT(Median(modelled.rotation), 0.022 * kRigDegree);
  EXPECT_LT(Median(modelled.workspace), 0.4e-3);
  EXPECT_LT(Worst(modelled.workspace), 1e-3);
  EXPECT_GT(Mean(modelled.chi2) / 6, 0.8);
  EXPECT_LT(Mean(modelled.chi2) / 6, 1.25);
  EXPECT_GT(Median(exact.workspace), 1.1 * Median(modelled.workspace));
  EXPECT_GT(Mean(exact.chi2), 2 * Mean(modelled.chi2));
}

// A view saw its board only in two of three frames above: here in each of thirty.
TEST(PoseAccuracy, ThirtySightingsByOneView) {
  Errors errors;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    PoseRig rig(seed, 1);
    rig.AddFlangeBoard();
    const Eigen::Vector3d at = rig.camera_poses[0].inverse().translation();
    for (int i = 0; rig.problem.sightings.size() < 30; ++i) {
      rig.Take("frame" + std::to_string(i), rig.RandomFlange(at));
    }
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
    ASSERT_TRUE(solution.ok()) << "seed " << seed << ": " << solution.status();
    errors.Add(rig, *solution);
  }
  Print("30 sightings", errors);
  EXPECT_LT(Median(errors.centre), 0.85e-3);
  EXPECT_LT(Median(errors.rotation), 0.022 * kRigDegree);
  EXPECT_LT(Median(errors.workspace), 0.4e-3);
  EXPECT_LT(Worst(errors.workspace), 0.8e-3);
}

TEST(PoseAccuracy, CameraOnTheFlange) {
  Errors errors;
  for (unsigned seed = 1; seed <= 6; ++seed) {
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
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
    ASSERT_TRUE(solution.ok()) << "seed " << seed << ": " << solution.status();
    ASSERT_TRUE(solution->views[0].on_flange);
    errors.Add(rig, *solution);
  }
  Print("camera on the flange", errors);
  EXPECT_LT(Median(errors.centre), 0.4e-3);
  EXPECT_LT(Median(errors.rotation), 0.022 * kRigDegree);
  EXPECT_GT(Mean(errors.chi2) / 6, 0.6);
  EXPECT_LT(Mean(errors.chi2) / 6, 1.5);
}

// Two views never see the flange; they are tied by boards that were held into the cell.
TEST(PoseAccuracy, BoardsSeenTogetherTieViewsThatDoNotSeeTheFlange) {
  Errors errors;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    PoseRig rig(seed);
    rig.AddFlangeBoard();
    rig.AddBoard("held", BoardPlace::kLoose, Eigen::Isometry3d::Identity(), 0.06, 2, 2);
    rig.Drive(30);
    std::erase_if(rig.problem.sightings, [](const TagSighting& seen) {
      return seen.view == "camera2" || seen.view == "camera3";
    });
    rig.Hold(1, 15);
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
    ASSERT_TRUE(solution.ok()) << "seed " << seed << ": " << solution.status();
    errors.Add(rig, *solution);
  }
  Print("two views by shared boards", errors);
  EXPECT_LT(Median(errors.workspace), 0.5e-3);
  EXPECT_GT(Mean(errors.chi2) / 6, 0.5);
  EXPECT_LT(Mean(errors.chi2) / 6, 1.6);
}

TEST(PoseAccuracy, SurveyedTagsPutViewsInTheBase) {
  Errors errors;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    PoseRig rig(seed);
    for (const auto& [x, y] : {std::pair(-0.7, -0.7), std::pair(0.7, -0.6), std::pair(0.6, 0.7),
                               std::pair(-0.6, 0.6), std::pair(0.0, 0.1)}) {
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.linear() = Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitX()).matrix();
      pose.translation() = Eigen::Vector3d(x, y, 0.2 * (1 + x));
      rig.AddBoard("floor" + std::to_string(rig.problem.boards.size()), BoardPlace::kSurveyed, pose,
                   0.15);
    }
    for (int i = 0; i < 3; ++i)
      rig.Take("frame" + std::to_string(i), Eigen::Isometry3d::Identity());
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
    ASSERT_TRUE(solution.ok()) << "seed " << seed << ": " << solution.status();
    errors.Add(rig, *solution);
  }
  Print("five tags surveyed to 1 mm", errors);
  EXPECT_LT(Median(errors.workspace), 2e-3);
  EXPECT_GT(Mean(errors.chi2) / 6, 0.7);
  EXPECT_LT(Mean(errors.chi2) / 6, 1.4);
}

}  // namespace
}  // namespace silhouette
