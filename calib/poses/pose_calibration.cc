#include "calib/poses/pose_calibration.h"

#include <algorithm>
#include <cmath>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/poses/pose_doubts.h"
#include "calib/poses/pose_fit.h"
#include "calib/poses/pose_report.h"
#include "calib/poses/words.h"

namespace silhouette {
namespace {

constexpr double kRobust = 3;          // sigmas
constexpr double kFirstRobust = 60;    // sigmas
constexpr double kCornerOutlier = 5;   // sigmas, of a residual's length
constexpr double kRobotOutlier = 6;    // sigmas, of a pose's six residuals together
constexpr double kMostOutliers = 0.4;  // share
// A noise that exceeds what was stated by this much is taken for what it is.
constexpr double kNoiseExcess = 1.3;

// How many times larger the errors are than stated, by their median.
double CornerFactor(const Bundle& bundle) {
  std::vector<double> lengths;
  for (const BundleCorner& corner : bundle.corners) {
    lengths.push_back(corner.residual.norm() / corner.sigma);
  }
  return std::max(1.0, MedianOf(std::move(lengths)) / 1.18);
}

double RobotFactor(const Bundle& bundle) {
  std::vector<double> lengths;
  for (const BundlePose& flange : bundle.flanges) {
    const double length = flange.PriorResidual().norm();
    if (length > 0) lengths.push_back(length);  // 0: nothing was seen in its frame
  }
  return lengths.empty() ? 1.0 : std::max(1.0, MedianOf(std::move(lengths)) / 2.3);
}

// Marks what is too far off, anew each time. Returns whether anything changed.
bool MarkOutliers(Bundle& bundle, std::vector<bool>& robot_outliers) {
  bool changed = false;
  const double corner_limit = kCornerOutlier * CornerFactor(bundle);
  for (BundleCorner& corner : bundle.corners) {
    const bool used = corner.residual.norm() < corner_limit * corner.sigma;
    changed = changed || used != corner.used;
    corner.used = used;
  }
  const double robot_limit = kRobotOutlier * RobotFactor(bundle);
  for (size_t i = 0; i < bundle.flanges.size(); ++i) {
    BundlePose& flange = bundle.flanges[i];
    if (flange.constant) continue;
    const bool outlier = flange.PriorResidual().norm() > robot_limit;
    changed = changed || outlier != robot_outliers[i];
    robot_outliers[i] = outlier;
    flange.has_prior = !outlier;
  }
  return changed;
}

absl::Status CheckOutliers(const Bundle& bundle, const std::vector<bool>& robot_outliers) {
  for (size_t view = 0; view < bundle.cameras.size(); ++view) {
    double all = 0;
    double left_out = 0;
    for (const BundleCorner& corner : bundle.corners) {
      if (corner.camera != static_cast<int>(view)) continue;
      all += 1;
      left_out += corner.used ? 0 : 1;
    }
    if (left_out > kMostOutliers * all) {
      return absl::FailedPreconditionError(absl::StrFormat(
          "%s: %.0f of %.0f corners do not fit the rest; see whether its lens, the boards' "
          "description and the frames' names are right",
          bundle.cameras[view].name, left_out, all));
    }
  }
  const auto poses = std::count(robot_outliers.begin(), robot_outliers.end(), true);
  if (static_cast<double>(poses) > kMostOutliers * static_cast<double>(robot_outliers.size())) {
    return absl::FailedPreconditionError(
        absl::StrCat(poses, " of ", robot_outliers.size(),
                     " poses of the robot do not fit what was seen; see whether they belong to "
                     "these frames"));
  }
  return absl::OkStatus();
}

absl::Status Undetermined(const std::string& what) {
  return absl::FailedPreconditionError(absl::StrCat(
      "the data do not determine the pose of ", what,
      "; add frames in which the flange is turned about other axes, or surveyed boards "
      "that this view sees"));
}

// The last solve: the outliers are known; noise larger than stated is taken for what it is.
class FinalSolve {
 public:
  FinalSolve(Bundle& bundle, BundleStatistics& statistics, NoiseFactors& factors)
      : bundle_(bundle), statistics_(statistics), factors_(factors) {}

  absl::Status Run() {
    for (int i = 0; i < 4; ++i) {
      if (!Adjust(bundle_, 0)) {
        return absl::FailedPreconditionError("no poses were found that explain what was seen");
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

  // Returns whether a noise had to be enlarged.
  bool EnlargeNoise() {
    const double image = Factor(statistics_.corner_chi2, statistics_.corner_redundancy);
    const double robot = Factor(statistics_.flange_chi2, statistics_.flange_redundancy);
    factors_.image = image_scale_ * image;
    factors_.robot = statistics_.flange_redundancy > 1 ? robot_scale_ * robot : 0;
    bool enlarged = false;
    if (image > kNoiseExcess) {
      image_scale_ *= image;
      enlarged = true;
      for (BundleCorner& corner : bundle_.corners) corner.sigma *= image;
    }
    if (robot > kNoiseExcess) {
      robot_scale_ *= robot;
      enlarged = true;
      for (BundlePose& flange : bundle_.flanges) {
        flange.position_sigma *= robot;
        flange.rotation_sigma *= robot;
      }
    }
    return enlarged;
  }

  Bundle& bundle_;
  BundleStatistics& statistics_;
  NoiseFactors& factors_;
  double image_scale_ = 1;
  double robot_scale_ = 1;
};

}  // namespace

absl::StatusOr<PoseSolution> CalibratePoses(const PoseProblem& problem) {
  absl::StatusOr<PoseFit> fit = FitWithExactRobot(problem);
  if (!fit.ok()) return fit.status();
  if (absl::Status checked = CheckFit(problem, *fit); !checked.ok()) return checked;
  Bundle& bundle = fit->bundle;
  for (BundlePose& flange : bundle.flanges) flange.constant = problem.robot_exact;
  // Flanges that the robot stated wrongly follow their corners first; then single corners that are
  // wrong lose their pull.
  if (!Adjust(bundle, kFirstRobust) || !AdjustStepwise(bundle, kRobust)) {
    return absl::FailedPreconditionError("no poses were found that explain what was seen");
  }
  std::vector<bool> robot_outliers(bundle.flanges.size(), false);
  for (int i = 0; i < 5 && MarkOutliers(bundle, robot_outliers); ++i) {
    if (!Adjust(bundle, 0)) break;
  }
  if (absl::Status sizes = CheckSizes(fit->network, bundle, fit->network.warnings); !sizes.ok()) {
    return sizes;
  }
  if (absl::Status checked = CheckOutliers(bundle, robot_outliers); !checked.ok()) return checked;
  BundleStatistics statistics;
  NoiseFactors factors;
  if (absl::Status solved = FinalSolve(bundle, statistics, factors).Run(); !solved.ok()) {
    return solved;
  }
  return SolutionOf(*fit, robot_outliers, statistics, factors);
}

}  // namespace silhouette
