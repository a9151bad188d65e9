// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "calib/poses/pose_fit.h"
#include "calib/poses/pose_problem.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// In sigmas: of a tag's residuals, root mean square per axis, and of a measured pose's six
// residuals together.
constexpr double kTagOutlier = 4.5;
constexpr double kPoseOutlier = 6;
constexpr double kMostOutliers = 0.4;  // share
// The median length of six normal values.
constexpr double kMedianPrior = 2.3;

// Residuals of corners together, in sigmas.
struct Sum {
  double squares = 0;
  int corners = 0;

  void Add(const BundleCorner& corner) {
    squares += (corner.residual / corner.sigma).squaredNorm();
    ++corners;
  }
  bool Fits() const { return std::sqrt(squares / (2 * corners)) < kTagOutlier; }
};

// What the robot said of a flange, and what was seen of it, with all else held fixed.
Bundle FlangeAlone(const Bundle& bundle, size_t flange) {
  Bundle alone;
  alone.lenses = bundle.lenses;
  alone.cameras = bundle.cameras;
  alone.board_poses = bundle.board_poses;
  for (auto* poses : {&alone.cameras, &alone.board_poses}) {
    for (BundlePose& pose : *poses) pose.constant = true;
  }
  alone.flanges = {bundle.flanges[flange]};
  alone.flanges[0].left_out = false;
  alone.sizes = bundle.sizes;
  for (const BundleCorner& corner : bundle.corners) {
    if (corner.flange != static_cast<int>(flange)) continue;
    alone.corners.push_back(corner);
    alone.corners.back().flange = 0;
  }
  return alone;
}

// Where a flange can be: where the robot says, and by both poses of each plane that was seen.
std::vector<Eigen::Isometry3d> PlacesOf(const PoseNetwork& network, const Bundle& alone) {
  std::vector<Eigen::Isometry3d> places = {alone.flanges[0].measured};
  size_t last = network.looks.size();
  for (const BundleCorner& corner : alone.corners) {
    if (corner.look == last) continue;
    last = corner.look;
    for (const Eigen::Isometry3d& seen : network.looks[last].candidates) {
      const Eigen::Isometry3d link = alone.cameras[corner.camera].pose.inverse() * seen *
                                     alone.board_poses[corner.board_pose].pose.inverse();
      places.push_back(corner.camera_on_flange ? link.inverse() : link);
    }
  }
  return places;
}

// A place of the flange at which what the robot said and what was seen agree.
bool FindAgreement(const PoseNetwork& network, size_t flange, double limit, Bundle& bundle) {
  Bundle alone = FlangeAlone(bundle, flange);
  for (const Eigen::Isometry3d& place : PlacesOf(network, alone)) {
    alone.flanges[0].pose = place;
    for (BundleCorner& corner : alone.corners) corner.used = true;
    if (!Adjust(alone, kRobust) || alone.flanges[0].PriorResidual().norm() > limit) continue;
    Sum sum;
    for (const BundleCorner& corner : alone.corners) sum.Add(corner);
    if (!sum.Fits()) continue;
    bundle.flanges[flange].pose = alone.flanges[0].pose;
    return true;
  }
  return false;
}

double LimitOf(const std::vector<BundlePose>& poses) {
  std::vector<double> lengths;
  for (const BundlePose& pose : poses) {
    if (!pose.has_prior || pose.constant) continue;
    const double length = pose.PriorResidual().norm();
    if (length > 0) lengths.push_back(length);  // 0: nothing was seen of it
  }
  if (lengths.empty()) return kPoseOutlier;
  return kPoseOutlier * std::max(1.0, Median(std::move(lengths)) / kMedianPrior);
}

template <typename Agrees>
bool MarkPoses(std::vector<BundlePose>& poses, const Agrees& agrees) {
  const double limit = LimitOf(poses);
  bool changed = false;
  for (size_t i = 0; i < poses.size(); ++i) {
    BundlePose& pose = poses[i];
    if (!pose.has_prior || pose.constant) continue;
    const bool left_out = pose.PriorResidual().norm() > limit && !agrees(i, limit);
    changed = changed || left_out != pose.left_out;
    pose.left_out = left_out;
  }
  return changed;
}

bool MarkTags(const PoseNetwork& network, Bundle& bundle) {
  constexpr size_t kLeastCorners = 4;
  std::map<size_t, Sum> tags;
  for (const BundleCorner& corner : bundle.corners) tags[corner.sighting].Add(corner);
  std::map<size_t, size_t> left;  // corners of each look
  for (const BundleCorner& corner : bundle.corners) {
    if (tags.at(corner.sighting).Fits()) ++left[corner.look];
  }
  bool changed = false;
  for (BundleCorner& corner : bundle.corners) {
    const size_t all = network.looks[corner.look].corners.size();
    const size_t least = std::max(std::min(all, kLeastCorners), (all + 1) / 2);
    const bool used = tags.at(corner.sighting).Fits() && left[corner.look] >= least;
    changed = changed || used != corner.used;
    corner.used = used;
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

bool MarkOutliers(const PoseNetwork& network, Bundle& bundle) {
  bool changed = MarkPoses(bundle.flanges, [&](size_t flange, double limit) {
    return FindAgreement(network, flange, limit, bundle);
  });
  changed = MarkPoses(bundle.board_poses, [](size_t, double) { return false; }) || changed;
  FindResiduals(bundle);
  return MarkTags(network, bundle) || changed;
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
      return FailedPrecondition(absl::StrFormat(
          "%s: %.0f of %.0f corners do not fit the rest; see whether its lens, the boards' "
          "description and the frames' names are right",
          bundle.cameras[view].name, share.left_out, share.all));
    }
  }
  if (const Share robot = ShareOf(bundle.flanges); robot.TooMuch()) {
    return FailedPrecondition(
        robot.left_out, " of ", robot.all,
        " poses of the robot do not fit what was seen; see whether they belong to "
        "these frames");
  }
  if (const Share survey = ShareOf(bundle.board_poses); survey.TooMuch()) {
    return FailedPrecondition(
        "the survey contradicts what was seen, or the robot's poses: ", survey.left_out, " of ",
        survey.all,
        " surveyed boards do not fit; see whether both are in the robot's base frame, "
        "in metres, and the boards' origins and axes as in their description");
  }
  return absl::OkStatus();
}

}  // namespace silhouette
