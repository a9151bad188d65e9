#include "calib/poses/pose_outliers.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/poses/words.h"

namespace silhouette {
namespace {

// In sigmas: of a corner's residual, and of a measured pose's six residuals together.
constexpr double kCornerOutlier = 5.5;
constexpr double kPoseOutlier = 6;
constexpr double kMostOutliers = 0.4;  // share
// The median lengths of two and of six normal values.
constexpr double kMedianOfTwo = 1.18;
constexpr double kMedianOfSix = 2.3;

double CornerFactor(const Bundle& bundle) {
  std::vector<double> lengths;
  for (const BundleCorner& corner : bundle.corners) {
    lengths.push_back(corner.residual.norm() / corner.sigma);
  }
  return std::max(1.0, MedianOf(std::move(lengths)) / kMedianOfTwo);
}

bool MarkPoses(std::vector<BundlePose>& poses) {
  std::vector<double> lengths;
  for (const BundlePose& pose : poses) {
    if (!pose.has_prior || pose.constant) continue;
    const double length = pose.PriorResidual().norm();
    if (length > 0) lengths.push_back(length);  // 0: nothing was seen of it
  }
  if (lengths.empty()) return false;
  const double limit = kPoseOutlier * std::max(1.0, MedianOf(std::move(lengths)) / kMedianOfSix);
  bool changed = false;
  for (BundlePose& pose : poses) {
    if (!pose.has_prior || pose.constant) continue;
    const bool left_out = pose.PriorResidual().norm() > limit;
    changed = changed || left_out != pose.left_out;
    pose.left_out = left_out;
  }
  return changed;
}

struct Share {
  double left_out = 0;
  double all = 0;
  bool TooMuch() const { return left_out > kMostOutliers * all; }
};

Share ShareOf(const std::vector<BundlePose>& poses) {
  Share share;
  for (const BundlePose& pose : poses) {
    share.all += pose.has_prior ? 1 : 0;
    share.left_out += pose.left_out ? 1 : 0;
  }
  return share;
}

}  // namespace

bool MarkOutliers(Bundle& bundle) {
  bool changed = false;
  const double corner_limit = kCornerOutlier * CornerFactor(bundle);
  for (BundleCorner& corner : bundle.corners) {
    const bool used = corner.residual.norm() < corner_limit * corner.sigma;
    changed = changed || used != corner.used;
    corner.used = used;
  }
  changed = MarkPoses(bundle.flanges) || changed;
  return MarkPoses(bundle.board_poses) || changed;
}

absl::Status CheckOutliers(const Bundle& bundle) {
  for (size_t view = 0; view < bundle.cameras.size(); ++view) {
    Share share;
    for (const BundleCorner& corner : bundle.corners) {
      if (corner.camera != static_cast<int>(view)) continue;
      share.all += 1;
      share.left_out += corner.used ? 0 : 1;
    }
    if (share.TooMuch()) {
      return absl::FailedPreconditionError(absl::StrFormat(
          "%s: %.0f of %.0f corners do not fit the rest; see whether its lens, the boards' "
          "description and the frames' names are right",
          bundle.cameras[view].name, share.left_out, share.all));
    }
  }
  if (const Share robot = ShareOf(bundle.flanges); robot.TooMuch()) {
    return absl::FailedPreconditionError(
        absl::StrCat(robot.left_out, " of ", robot.all,
                     " poses of the robot do not fit what was seen; see whether they belong to "
                     "these frames"));
  }
  if (const Share survey = ShareOf(bundle.board_poses); survey.TooMuch()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the survey contradicts what was seen, or the robot's poses: ", survey.left_out, " of ",
        survey.all,
        " surveyed boards do not fit; see whether both are in the robot's base frame, "
        "in metres, and the boards' origins and axes as in their description"));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
