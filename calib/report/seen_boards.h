// Where boards were seen, and how they were turned.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "calib/poses/pose_network.h"
#include "calib/poses/pose_solution.h"

namespace silhouette {

// Corners of boards that are fixed to something, by a solution, in the world of views on the flange
// or of all others: points all over the box around them.
std::vector<Eigen::Vector3d> SpaceOfBoards(const PoseNetwork& network, const PoseSolution& solution,
                                           bool on_flange);

// ReportView::tilt_deg. By what each look alone says; the network has its candidates.
std::optional<double> TiltOf(const PoseNetwork& network, int view);

// The frames whose pose of the robot was left out and fits the one of the frame after it (`by` 1)
// or before it (-1) far better, by what each look alone says. `network`: of the problem, with
// candidates.
std::vector<std::string> FramesThatFitAnother(const PoseNetwork& network,
                                              const PoseSolution& solution, int by);

}  // namespace silhouette
