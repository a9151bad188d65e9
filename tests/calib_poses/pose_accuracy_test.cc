// How exact camera poses are, over several seeds, and whether they are as exact as they say.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "calib/poses/pose_calibration.h"
#include "tests/calib_poses/pose_rig.h"

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

PoseRig FlangeRig(unsigned seed) {
  PoseRig rig(seed);
  rig.AddFlangeBoard();
  rig.Drive(30);
  return rig;
}

TEST(PoseAccuracy, ThirtyPosesOfATagOnTheFlange) {
  Errors modelled;
  Errors exact;
  for (unsigned seed = 1; seed <= 15; ++seed) {
    PoseRig rig = FlangeRig(seed);
    const absl::StatusOr<PoseSolution> solution = CalibratePoses(rig.problem);
    ASSERT_TRUE(solution.ok()) << "seed " << seed << ": " << solution.status();
    modelled.Add(rig, *solution);
    EXPECT_NEAR(solution->chi2_per_dof, 1, 0.2) << "seed " << seed;
    rig.problem.robot_exact = true;
    const absl::StatusOr<PoseSolution> naive = CalibratePoses(rig.problem);
    ASSERT_TRUE(naive.ok()) << "seed " << seed << ": " << naive.status();
    exact.Add(rig, *naive);
  }
  Print("robot noise modelled", modelled);
  Print("robot taken at its word", exact);
  EXPECT_LT(Median(modelled.centre), 0.85e-3);
  EXPECT_LT(Median(modelled.rotation), 0.022 * kRigDegree);
  EXPECT_LT(Worst(modelled.workspace), 0.4e-3);
  EXPECT_GT(Mean(modelled.chi2) / 6, 0.8);
  EXPECT_LT(Mean(modelled.chi2) / 6, 1.25);
  EXPECT_GT(Median(exact.workspace), 1.1 * Median(modelled.workspace));
}

}  // namespace
}  // namespace silhouette
