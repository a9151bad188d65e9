// SPDX-License-Identifier: Apache-2.0
// Whether a camera sees the robot's workspace where its lens is known.
#pragma once

#include <Eigen/Geometry>
#include <string>

#include "calib/poses/pose_problem.h"

namespace silhouette {

struct UnknownLens {
  std::string sentence;  // empty: the lens is known, or it is not said where it is
  // Whether the poses are to be refused. Not for regions without LensRegion::sigma: their makers
  // may leave out places where the lens is known well enough.
  bool refused = false;
};

// Of one of the problem's views that is not on the flange, in this pose: which share of the
// problem's workspace, as far as it is in the image, is outside of the region where the lens is
// known. A sentence is there from 1 % on, with the places in the image and the mend.
UnknownLens FindUnknownLens(const PoseProblem& problem, const PoseView& view,
                            const Eigen::Isometry3d& camera_from_base);

}  // namespace silhouette
