// SPDX-License-Identifier: Apache-2.0
// Planning with OMPL on the verdicts of one scene.
//
//   const auto snapshot = space.Snapshot();
//   const auto si = silhouette::client::MakeSpaceInformation(snapshot);
//   ompl::geometric::SimpleSetup setup(si);
//   setup.setStartState(silhouette::client::StateOf(si, q)); ...
//
// Motions are checked exactly (SpaceSnapshot::CheckMotion), so that a path that a planner finds is
// free between its states, too.
#pragma once

#include <ompl/base/OptimizationObjective.h>
#include <ompl/base/PlannerTerminationCondition.h>
#include <ompl/base/ScopedState.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/PathGeometric.h>

#include <memory>
#include <span>
#include <vector>

#include "silhouette/configuration_grid.h"
#include "silhouette/configuration_space.h"
#include "silhouette/local_space.h"

namespace silhouette::client {

// A subspace for each joint of the grid: SO(2) for a continuous one, else its range. Radians;
// metres for prismatic joints.
class JointStateSpace : public ompl::base::CompoundStateSpace {
 public:
  explicit JointStateSpace(std::span<const GridJoint> joints);

  // One value per joint; not checked. Values of continuous joints are brought into the turn.
  void SetState(std::span<const double> q, ompl::base::State* state) const;
  void GetValues(const ompl::base::State* state, std::span<double> q) const;
  // The values of `state` that a motion from `from` goes to: a continuous joint takes the shorter
  // way, beyond the turn if need be.
  void GetValuesNear(std::span<const double> from, const ompl::base::State* state,
                     std::span<double> q) const;

  void registerProjections() override;

 private:
  std::vector<GridJoint> joints_;
};

struct SpaceInformationOptions {
  // As SpaceSnapshot::CheckMotion has it.
  double path_resolution = 0.005;
  // If set, asked for what the snapshot does not decide (CheckMotionOrAsk); by then it may have
  // another scene. Must outlive the space information.
  const LocalSpace* ask = nullptr;
};

// State space, validity and motions of a snapshot, set up. The verdicts are those of the snapshot's
// scene, and unknown, that is invalid, once it expires. For any number of threads. Throws
// std::invalid_argument if there is no snapshot, or it has no grid (before the first update), or if
// `path_resolution` cannot be.
ompl::base::SpaceInformationPtr MakeSpaceInformation(std::shared_ptr<const SpaceSnapshot> snapshot,
                                                     const SpaceInformationOptions& options = {});

// `si`: of MakeSpaceInformation. Throws std::invalid_argument without one value per joint.
ompl::base::ScopedState<> StateOf(const ompl::base::SpaceInformationPtr& si,
                                  std::span<const double> q);

// The path's waypoints from `start`, the values that the robot has: CheckPath and robots take
// continuous joints the way that values say.
std::vector<Configuration> WaypointsOf(const ompl::geometric::PathGeometric& path,
                                       std::span<const double> start);

// Whether every motion of a path is free in the snapshot: whether a path from an older one is still
// good.
bool IsPathFree(const SpaceSnapshot& snapshot, std::span<const Configuration> waypoints,
                double path_resolution = 0.005);

// Ends planning on `snapshot` when it expires, when nothing is known in a newer one, or when a
// newer scene has a configuration of `needed` (start, goal) that is not free (CheckMotionOrAsk,
// once for each new snapshot): take a new snapshot and plan again. It stays true. Asking may take
// the client's timeout. `space` must outlive it.
ompl::base::PlannerTerminationCondition UntilSceneChanges(
    const LocalSpace& space, std::shared_ptr<const SpaceSnapshot> snapshot,
    std::vector<Configuration> needed);

// Prefers clearance: the cost of a state is 1 / (1 + the clearance in mask pixels that it exceeds),
// summed along the path. `clearances`: with levels (Client::GetConfigurationSpace); not exact off
// the grid, where the nearest grid point counts.
ompl::base::OptimizationObjectivePtr MakeClearanceObjective(
    const ompl::base::SpaceInformationPtr& si,
    std::shared_ptr<const ConfigurationSpace> clearances);

}  // namespace silhouette::client
