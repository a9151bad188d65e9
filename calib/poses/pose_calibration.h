// SPDX-License-Identifier: Apache-2.0
// Camera poses in the robot's base frame, from all that is known at once: boards on the flange,
// surveyed boards, boards that several views see in one frame, and cameras on the flange.
//
// Seeds come from each board's pose in the camera's frame (IPPE, both solutions) and Park's method
// for robot-world/hand-eye; then a bundle over all corners in pixels in which every flange pose
// has the robot's noise, every surveyed board the survey's, and outliers are reported by frame.
#pragma once

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"

namespace silhouette {

// InvalidArgument: the problem is wrong in itself: names or tags twice, a view that is not there.
// FailedPrecondition: the data do not determine the poses or contradict each other; the message
// says why, and what would mend it: too few poses, rotations about one axis only, no base frame,
// views without connection (named), another tag size, poses shifted by one frame, in millimetres,
// inverted or with quaternions in another order, mirrored boards.
absl::StatusOr<PoseSolution> CalibratePoses(const PoseProblem& problem);

}  // namespace silhouette
