// SPDX-License-Identifier: Apache-2.0
// Joints that captured configurations say too little of: they hardly moved, or look the same
// whichever way they turn.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/drawing/kinematic_chain.h"
#include "capture/verification/model_comparison.h"
#include "db/mask/configuration_grid.h"

namespace silhouette {

// A sentence for each joint that moved through less than `least_moved` of its range: of the least
// arc that holds all its values, if it turns, and of no more than a turn. Values that are turns
// apart are one: they show the same. `joints`: the ranges, by joint of the chain and of
// ModelSample::q.
std::vector<std::string> UnmovedJoints(const KinematicChain& chain,
                                       std::span<const GridJoint> joints,
                                       std::span<const ModelSample> samples, double least_moved);

// A sentence for each joint that turns of which the samples do not show which way: at all of them
// `grown` holds `bare` turned the other way, and by far not everywhere in its range. `grown`:
// `bare` with the growth that the samples need.
std::vector<std::string> UndirectedJoints(const DrawnRobot& bare, const DrawnRobot& grown,
                                          std::span<const GridJoint> joints,
                                          std::span<const ModelSample> samples);

}  // namespace silhouette
