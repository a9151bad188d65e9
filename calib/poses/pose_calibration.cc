// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_calibration.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/poses/pose_fit.h"
#include "calib/poses/pose_noise.h"
#include "calib/poses/unknown_lens.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr double kFirstRobust = 60;  // sigmas
// Rounds of noise and outliers.
constexpr int kMostRounds = 10;

absl::Status Undetermined(const std::string& what) {
  return FailedPrecondition(
      "the data do not determine the pose of ", what,
      "; add frames in which the flange is turned about other axes, or surveyed boards "
      "that this view sees");
}

// Noise larger than stated is taken into account; contradictions are refused.
absl::Status CheckNoise(const PoseFit& fit, const NoiseFactors& factors) {
  constexpr double kContradiction = 10;
  if (factors.survey > kContradiction) {
    return FailedPrecondition(absl::StrFormat(
        "the survey contradicts what was seen, or the robot's poses: boards are off by %.0f times "
        "the survey's sigma; see whether survey and robot have the same base frame, in metres, and "
        "whether origins and axes are those of the boards' description",
        factors.survey));
  }
  if (factors.robot > kContradiction && !fit.size_explains) {
    const BundlePose& flange = fit.bundle.flanges.front();  // enlarged already
    return FailedPrecondition(absl::StrFormat(
        "the robot's poses are off by %.0f times their sigma, about %.1f mm and %.2f deg; see "
        "whether the robot stood still and its model is right, or state how exact it is with "
        "--robot-sigma",
        factors.robot, 1000 * flange.position_sigma, flange.rotation_sigma / kDegree));
  }
  return absl::OkStatus();
}

absl::Status Refit(Bundle& bundle) {
  if (Adjust(bundle, 0)) return absl::OkStatus();
  return FailedPrecondition("no poses were found that explain what was seen");
}

absl::StatusOr<BundleStatistics> StatisticsOf(Bundle& bundle) {
  BundleStatistics statistics = FindCovariances(bundle);
  if (!statistics.undetermined.empty()) return Undetermined(statistics.undetermined);
  return statistics;
}

// Finds how large the errors are, and what does not fit by that.
absl::Status SortOut(const PoseProblem& problem, const PoseNetwork& network, NoiseModel& noise,
                     Bundle& bundle) {
  for (int i = 0; i < kMostRounds; ++i) {
    problem.step(absl::StrCat("noise and outliers, round ", i + 1));
    ASSIGN_OR_RETURN(const BundleStatistics statistics, StatisticsOf(bundle));
    const bool other_noise = noise.Estimate(statistics, NoiseModel::By::kMedians);
    const bool other_outliers = MarkOutliers(network, bundle);
    if (!other_noise && !other_outliers) break;
    RETURN_IF_ERROR(Refit(bundle));
  }
  return absl::OkStatus();
}

// The last solve: the outliers are known.
absl::StatusOr<BundleStatistics> SolveFinally(const PoseProblem& problem, NoiseModel& noise,
                                              Bundle& bundle) {
  for (int i = 0;; ++i) {
    problem.step(absl::StrCat("last solve, round ", i + 1));
    RETURN_IF_ERROR(Refit(bundle));
    ASSIGN_OR_RETURN(BundleStatistics statistics, StatisticsOf(bundle));
    if (i == kMostRounds || !noise.Estimate(statistics, NoiseModel::By::kSquares)) {
      return statistics;
    }
  }
}

}  // namespace

absl::StatusOr<PoseSolution> CalibratePoses(const PoseProblem& problem) {
  problem.step("first poses");
  ASSIGN_OR_RETURN(PoseFit fit, FitWithExactRobot(problem));
  RETURN_IF_ERROR(CheckFit(problem, fit));
  problem.step("all poses together");
  Bundle& bundle = fit.bundle;
  for (BundlePose& flange : bundle.flanges) flange.constant = problem.robot_exact;
  // Flanges that the robot stated wrongly follow their corners first; then corners that are wrong
  // lose their pull.
  if (!Adjust(bundle, kFirstRobust) || !AdjustStepwise(bundle, kRobust)) {
    return FailedPrecondition("no poses were found that explain what was seen");
  }
  NoiseModel noise(bundle);
  RETURN_IF_ERROR(SortOut(problem, fit.network, noise, bundle));
  RETURN_IF_ERROR(CheckSizes(problem.size_trust, fit));
  // With other sizes other corners fit.
  if (bundle.free_sizes) RETURN_IF_ERROR(SortOut(problem, fit.network, noise, bundle));
  RETURN_IF_ERROR(CheckOutliers(bundle));
  ASSIGN_OR_RETURN(const BundleStatistics statistics, SolveFinally(problem, noise, bundle));
  problem.step("errors that images share, lenses that do not fit, and motions");
  ASSIGN_OR_RETURN(LinearBundle linear, CountCommonErrors(bundle));
  RETURN_IF_ERROR(CheckFinalSizes(problem.size_trust, fit));
  ASSIGN_OR_RETURN(PoseMisfits misfits, FindMisfits(problem.robot_noise, std::move(linear), fit));
  misfits.doubts.insert(misfits.doubts.end(), fit.doubts.begin(), fit.doubts.end());
  for (size_t i = 0; i < problem.views.size(); ++i) {
    UnknownLens lens = FindUnknownLens(problem, problem.views[i], bundle.cameras[i].pose);
    if (lens.sentence.empty()) continue;
    (lens.refused ? misfits.doubts : misfits.warnings).push_back(std::move(lens.sentence));
  }
  if (!misfits.doubts.empty() && !problem.accept_doubts) {
    return FailedPrecondition(absl::StrJoin(misfits.doubts, "; "), "; 'silhouette-calibrate poses ",
                              "--accept-doubts' finds the poses nevertheless");
  }
  const NoiseFactors factors = noise.Factors(statistics);
  RETURN_IF_ERROR(CheckNoise(fit, factors));
  for (const auto* sentences : {&misfits.doubts, &misfits.warnings}) {
    fit.network.warnings.insert(fit.network.warnings.end(), sentences->begin(), sentences->end());
  }
  PoseSolution solution = SolutionOf(fit, statistics, factors);
  solution.doubts = std::move(misfits.doubts);
  RETURN_IF_ERROR(CheckWeakness(problem.least_frames, fit, solution));
  return solution;
}

}  // namespace silhouette
