// SPDX-License-Identifier: Apache-2.0
// A problem brought near its minimum with the robot taken at its word: what everything else begins
// with, and by which guesses of what is wrong are compared.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/poses/linear_bundle.h"
#include "calib/poses/pose_bundle.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_network.h"
#include "calib/poses/pose_noise.h"

namespace silhouette {

struct PoseFit {
  PoseNetwork network;
  Bundle bundle;  // flanges are constant, sizes too but for SizeTrust::kFound
  // Per view: the median length of a corner's residual, and what it should be by the sigmas stated.
  std::vector<double> median_px;
  std::vector<double> expected_px;
  // Boards' sizes other than stated explain what does not fit.
  bool size_explains = false;
  std::vector<std::string> doubts = {};  // as in PoseMisfits, of sizes
};

// A corner of a look; its board's pose and size are to be set where they differ from the network's.
BundleCorner CornerOf(const PoseNetwork& network, size_t look, size_t place);

// Errors as those of CalibratePoses, except for what only a contradiction in the data shows.
absl::StatusOr<PoseFit> FitWithExactRobot(const PoseProblem& problem);

// Of AdjustStepwise, in sigmas: from here on a corner loses its pull.
inline constexpr double kRobust = 3;

// Adjusts with corners that are far off counting less, from what the median is now down to
// `robust` sigmas. As Adjust.
bool AdjustStepwise(Bundle& bundle, double robust);

// Tags, poses of the robot and surveyed places that do not fit the rest.

// Marks again what is too far off (BundleCorner::used, BundlePose::left_out), in the sigmas of a
// NoiseModel. A tag is left out as a whole, and with it a look of which less than half, or less
// than a pose needs, is left. A robot's pose is left out only if the plane's other pose does not
// agree with it either. Returns whether anything changed.
bool MarkOutliers(const PoseNetwork& network, Bundle& bundle);

// FailedPrecondition if so much was left out that nothing can be called the rest.
absl::Status CheckOutliers(const Bundle& bundle);

// What may be wrong where data do not fit together: each guess is tried, and believed only if the
// data fit far better with it.

// FailedPrecondition, with the reason and the mend, if the fit is far from what the stated sigmas
// explain and a guess explains it - or nothing does. Of sizes, as CheckSizes.
absl::Status CheckFit(const PoseProblem& problem, PoseFit& fit);

// Limits of boards' sizes, by corners or by pairs of poses; shares of the size.
inline constexpr double kMentionedSize = 0.001;
// Off by more, a size is refused where nothing is to be trusted.
inline constexpr double kRefusedSize = 0.01;
// Sigmas by which a size differs from the stated one for certain.
inline constexpr double kCertainSize = 5;
// A size is unchecked from this sigma on: what is then certain is 2.5 %, by which a page that was
// printed to fit its paper is off. A flange that moves by 3 cm all around gives 0.25 %.
inline constexpr double kUncheckedSize = 0.005;
// Metres by which points of the workspace may be elsewhere if an unchecked size is off, or a part
// of the data is left out.
inline constexpr double kHarmlessShift = 1e-3;

// Compares the boards' sizes with what the robot's motion or the survey says of them, at the
// minimum of the fit, which has the sizes found if that is what `trust` says. A size that is off is
// a warning, and the fit has the sizes found unless those stated are to be trusted; from 1 % on it
// is FailedPrecondition if nothing is to be trusted. Sizes that motion and survey do not tell,
// though the poses rest on them, are a doubt, or a warning if those stated are to be trusted.
absl::Status CheckSizes(SizeTrust trust, PoseFit& fit);
// The same limit on the sizes of the last solve, with its covariances: FailedPrecondition.
absl::Status CheckFinalSizes(SizeTrust trust, const PoseFit& fit);

// Lenses that are not as described, and cameras and boards that moved meanwhile: what the residuals
// of the last solve have in common by place in the image, and by time.
struct PoseMisfits {
  std::vector<std::string> doubts;  // sentences, of what makes the poses wrong
  std::vector<std::string> warnings;
};

// `linear`: by CountCommonErrors of the fit's bundle. Adds to the covariances what lenses that do
// not fit cost.
absl::StatusOr<PoseMisfits> FindMisfits(const RobotNoise& noise, LinearBundle linear, PoseFit& fit);

// A solved bundle as a PoseSolution.

// Where boards were seen, in the base, or in the flange for views on it.
class WorkspaceBoxes {
 public:
  explicit WorkspaceBoxes(const PoseFit& fit);
  // A lattice of points, metres; none if nothing was seen there.
  std::vector<Eigen::Vector3d> PointsFor(bool on_flange) const;

 private:
  Eigen::AlignedBox3d in_base_;
  Eigen::AlignedBox3d in_flange_;
};

// By how much each view has these points elsewhere with the poses of `other`: root mean square,
// metres.
std::vector<double> ShiftsOf(const PoseFit& fit, const Bundle& other);

// The bundle's covariances must have been found.
PoseSolution SolutionOf(const PoseFit& fit, const BundleStatistics& statistics,
                        const NoiseFactors& factors);

// By how much points of the workspace may be elsewhere without a part of the data, where `sigma` is
// predicted; metres.
inline double MostShift(double sigma) { return std::max(kHarmlessShift, 4 * sigma); }
// Of up to this many frames each is tried; of more only that of DecisiveTurn.
inline constexpr size_t kMostFramesTried = 12;
// Of these turns of the flange in its base the one that alone may decide a pose: it has a large
// share of all that turns about a second axis.
std::optional<size_t> DecisiveTurn(std::span<const Eigen::Matrix3d> turns);

// FailedPrecondition, with how many more frames of which kind would mend it, if so little holds the
// poses that a mistake would not show: fewer than `least_frames` poses of the robot and no survey,
// hardly more measurements than unknowns, or a view that saw no surveyed board and whose pose a
// single frame decides.
absl::Status CheckWeakness(int least_frames, const PoseFit& fit, const PoseSolution& solution);

}  // namespace silhouette
