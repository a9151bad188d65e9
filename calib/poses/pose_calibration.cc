// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_calibration.h"

#include <cmath>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "calib/poses/pose_fit.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr double kFirstRobust = 60;  // sigmas
// A noise that exceeds what was stated by this much is taken for what it is.
constexpr double kNoiseExcess = 1.3;

absl::Status Undetermined(const std::string& what) {
  return FailedPrecondition(
      "the data do not determine the pose of ", what,
      "; add frames in which the flange is turned about other axes, or surveyed boards "
      "that this view sees");
}

// Noise larger than stated is taken into account; contradictions are refused.
absl::Status CheckNoise(const Bundle& bundle, const NoiseFactors& factors) {
  constexpr double kContradiction = 10;
  if (factors.survey > kContradiction) {
    return FailedPrecondition(absl::StrFormat(
        "the survey contradicts what was seen, or the robot's poses: boards are off by %.0f times "
        "the survey's sigma; see whether survey and robot have the same base frame, in metres, and "
        "whether origins and axes are those of the boards' description",
        factors.survey));
  }
  if (factors.robot > kContradiction) {
    const BundlePose& flange = bundle.flanges.front();  // enlarged already
    return FailedPrecondition(absl::StrFormat(
        "the robot's poses are off by %.0f times their sigma, about %.1f mm and %.2f deg; see "
        "whether the robot stood still and its model is right, or state how exact it is with "
        "--robot-sigma",
        factors.robot, 1000 * flange.position_sigma, flange.rotation_sigma / kDegree));
  }
  return absl::OkStatus();
}

// The last solve: the outliers are known; noise larger than stated is taken for what it is.
class FinalSolve {
 public:
  FinalSolve(Bundle& bundle, BundleStatistics& statistics, NoiseFactors& factors)
      : bundle_(bundle), statistics_(statistics), factors_(factors) {}

  absl::Status Run() {
    for (int i = 0; i < 4; ++i) {
      if (!Adjust(bundle_, 0)) {
        return FailedPrecondition("no poses were found that explain what was seen");
      }
      statistics_ = FindCovariances(bundle_);
      if (!statistics_.undetermined.empty()) return Undetermined(statistics_.undetermined);
      if (i == 0)
        factors_.chi2_per_dof = statistics_.dof > 0 ? statistics_.chi2 / statistics_.dof : 0;
      if (!EnlargeNoise()) break;
    }
    return absl::OkStatus();
  }

 private:
  static double Factor(double chi2, double redundancy) {
    return redundancy > 1 ? std::sqrt(chi2 / redundancy) : 1;
  }

  // Takes a part's noise for `excess` times what it was, if that is clear. Returns whether it did.
  static bool Enlarge(double excess, double& scale, std::vector<BundlePose>& poses) {
    if (!(excess > kNoiseExcess)) return false;
    scale *= excess;
    for (BundlePose& pose : poses) {
      pose.position_sigma *= excess;
      pose.rotation_sigma *= excess;
    }
    return true;
  }

  // Returns whether a noise had to be enlarged.
  bool EnlargeNoise() {
    const double image = Factor(statistics_.corner_chi2, statistics_.corner_redundancy);
    const double robot = Factor(statistics_.flange_chi2, statistics_.flange_redundancy);
    const double survey = Factor(statistics_.survey_chi2, statistics_.survey_redundancy);
    factors_.image = image_scale_ * image;
    factors_.robot = statistics_.flange_redundancy > 1 ? robot_scale_ * robot : 0;
    factors_.survey = statistics_.survey_redundancy > 1 ? survey_scale_ * survey : 0;
    bool enlarged = Enlarge(robot, robot_scale_, bundle_.flanges);
    enlarged = Enlarge(survey, survey_scale_, bundle_.board_poses) || enlarged;
    if (image > kNoiseExcess) {
      image_scale_ *= image;
      enlarged = true;
      for (BundleCorner& corner : bundle_.corners) corner.sigma *= image;
    }
    return enlarged;
  }

  Bundle& bundle_;
  BundleStatistics& statistics_;
  NoiseFactors& factors_;
  double image_scale_ = 1;
  double robot_scale_ = 1;
  double survey_scale_ = 1;
};

}  // namespace

absl::StatusOr<PoseSolution> CalibratePoses(const PoseProblem& problem) {
  ASSIGN_OR_RETURN(PoseFit fit, FitWithExactRobot(problem));
  RETURN_IF_ERROR(CheckFit(problem, fit));
  Bundle& bundle = fit.bundle;
  for (BundlePose& flange : bundle.flanges) flange.constant = problem.robot_exact;
  // Flanges that the robot stated wrongly follow their corners first; then single corners that are
  // wrong lose their pull.
  if (!Adjust(bundle, kFirstRobust) || !AdjustStepwise(bundle, kRobust)) {
    return FailedPrecondition("no poses were found that explain what was seen");
  }
  for (int i = 0; i < 5 && MarkOutliers(bundle); ++i) {
    if (!Adjust(bundle, 0)) break;
  }
  RETURN_IF_ERROR(CheckSizes(fit.network, bundle, fit.network.warnings));
  RETURN_IF_ERROR(CheckOutliers(bundle));
  BundleStatistics statistics;
  NoiseFactors factors;
  RETURN_IF_ERROR(FinalSolve(bundle, statistics, factors).Run());
  RETURN_IF_ERROR(CheckNoise(bundle, factors));
  return SolutionOf(fit, statistics, factors);
}

}  // namespace silhouette
