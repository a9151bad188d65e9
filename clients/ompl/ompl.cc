// SPDX-License-Identifier: Apache-2.0
#include "silhouette/ompl.h"

#include <ompl/base/MotionValidator.h>
#include <ompl/base/StateValidityChecker.h>
#include <ompl/base/objectives/StateCostIntegralObjective.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <optional>
#include <stdexcept>
#include <utility>

namespace silhouette::client {
namespace {

namespace ob = ompl::base;

using Values = std::array<double, kMaxJoints>;

const JointStateSpace& JointsOf(const ob::SpaceInformation& si) {
  return *si.getStateSpace()->as<JointStateSpace>();
}

class SnapshotValidity : public ob::StateValidityChecker {
 public:
  SnapshotValidity(const ob::SpaceInformationPtr& si, std::shared_ptr<const SpaceSnapshot> snapshot,
                   const LocalSpace* ask)
      : ob::StateValidityChecker(si), snapshot_(std::move(snapshot)), ask_(ask) {}

  bool isValid(const ob::State* state) const override {
    Values values;
    const std::span<double> q = std::span(values).first(snapshot_->grid()->joints().size());
    JointsOf(*si_).GetValues(state, q);
    const State here = snapshot_->Check(q).state;
    if (here != State::kUnknown || ask_ == nullptr || snapshot_->unknown_reason()) {
      return here == State::kFree;
    }
    return ask_->CheckMotionOrAsk(q, q).free();
  }

 private:
  const std::shared_ptr<const SpaceSnapshot> snapshot_;
  const LocalSpace* const ask_;
};

// Does not count motions: several threads may use it.
class SnapshotMotions : public ob::MotionValidator {
 public:
  SnapshotMotions(const ob::SpaceInformationPtr& si, std::shared_ptr<const SpaceSnapshot> snapshot,
                  const SpaceInformationOptions& options)
      : ob::MotionValidator(si), snapshot_(std::move(snapshot)), options_(options) {}

  bool checkMotion(const ob::State* from, const ob::State* to) const override {
    return Check(from, to).free();
  }

  bool checkMotion(const ob::State* from, const ob::State* to,
                   std::pair<ob::State*, double>& last_valid) const override {
    const MotionVerdict motion = Check(from, to);
    if (motion.free()) return true;
    last_valid.second = motion.last_free;
    if (last_valid.first != nullptr) {
      si_->getStateSpace()->interpolate(from, to, motion.last_free, last_valid.first);
    }
    return false;
  }

 private:
  MotionVerdict Check(const ob::State* from, const ob::State* to) const {
    const JointStateSpace& space = JointsOf(*si_);
    const size_t joints = snapshot_->grid()->joints().size();
    Values first;
    Values last;
    space.GetValues(from, std::span(first).first(joints));
    const auto begin = std::span<const double>(first).first(joints);
    space.GetValuesNear(begin, to, std::span(last).first(joints));
    const auto end = std::span<const double>(last).first(joints);
    const MotionVerdict here = snapshot_->CheckMotion(begin, end, options_.path_resolution);
    if (here.state != State::kUnknown || options_.ask == nullptr || snapshot_->unknown_reason()) {
      return here;
    }
    return options_.ask->CheckMotionOrAsk(begin, end, options_.path_resolution);
  }

  const std::shared_ptr<const SpaceSnapshot> snapshot_;
  const SpaceInformationOptions options_;
};

class ClearanceObjective : public ob::StateCostIntegralObjective {
 public:
  ClearanceObjective(const ob::SpaceInformationPtr& si,
                     std::shared_ptr<const ConfigurationSpace> clearances)
      : ob::StateCostIntegralObjective(si, /*enableMotionCostInterpolation=*/true),
        clearances_(std::move(clearances)) {}

  ob::Cost stateCost(const ob::State* state) const override {
    Values values;
    const std::span<double> q = std::span(values).first(clearances_->grid().joints().size());
    JointsOf(*si_).GetValues(state, q);
    const std::optional<ConfigurationNumber> nearest = clearances_->grid().Nearest(q);
    const double exceeds = nearest ? clearances_->ClearanceAt(*nearest).exceeds.value_or(0) : 0;
    return ob::Cost(1 / (1 + exceeds));
  }

 private:
  const std::shared_ptr<const ConfigurationSpace> clearances_;
};

void RequireJoints(const JointStateSpace& space, std::span<const double> q) {
  if (q.size() != space.getSubspaceCount()) {
    throw std::invalid_argument("a configuration has one value per joint");
  }
}

}  // namespace

ob::SpaceInformationPtr MakeSpaceInformation(std::shared_ptr<const SpaceSnapshot> snapshot,
                                             const SpaceInformationOptions& options) {
  if (snapshot == nullptr || snapshot->grid() == nullptr) {
    throw std::invalid_argument("the snapshot has no grid: wait for an update (WaitForUpdate)");
  }
  const Configuration any(snapshot->grid()->joints().size());
  snapshot->CheckMotion(any, any, options.path_resolution);  // throws if the resolution cannot be
  auto si = std::make_shared<ob::SpaceInformation>(
      std::make_shared<JointStateSpace>(snapshot->grid()->joints()));
  si->setStateValidityChecker(std::make_shared<SnapshotValidity>(si, snapshot, options.ask));
  si->setMotionValidator(std::make_shared<SnapshotMotions>(si, std::move(snapshot), options));
  si->setup();
  return si;
}

ob::ScopedState<> StateOf(const ob::SpaceInformationPtr& si, std::span<const double> q) {
  RequireJoints(JointsOf(*si), q);
  ob::ScopedState<> state(si);
  JointsOf(*si).SetState(q, state.get());
  return state;
}

std::vector<Configuration> WaypointsOf(const ompl::geometric::PathGeometric& path,
                                       std::span<const double> start) {
  const JointStateSpace& space = JointsOf(*path.getSpaceInformation());
  RequireJoints(space, start);
  std::vector<Configuration> waypoints;
  Configuration last(start.begin(), start.end());
  Configuration from = last;
  for (size_t i = 0; i < path.getStateCount(); ++i) {
    const ob::State* state = path.getState(static_cast<unsigned int>(i));
    Configuration q(last.size());
    // The way that the motion validator looks at: of half a turn, the other one ends there, too.
    space.GetValuesNear(from, state, q);
    for (size_t j = 0; j < q.size(); ++j) {
      const bool turns = space.getSubspace(j)->getType() == ob::STATE_SPACE_SO2;
      if (turns) q[j] = last[j] + (q[j] - from[j]);
    }
    space.GetValues(state, from);
    waypoints.push_back(q);
    last = std::move(q);
  }
  return waypoints;
}

bool IsPathFree(const SpaceSnapshot& snapshot, std::span<const Configuration> waypoints,
                double path_resolution) {
  if (waypoints.empty()) return false;
  if (waypoints.size() == 1) return snapshot.Check(waypoints.front()).free();
  for (size_t i = 0; i + 1 < waypoints.size(); ++i) {
    if (!snapshot.CheckMotion(waypoints[i], waypoints[i + 1], path_resolution).free()) return false;
  }
  return true;
}

ob::PlannerTerminationCondition UntilSceneChanges(const LocalSpace& space,
                                                  std::shared_ptr<const SpaceSnapshot> snapshot,
                                                  std::vector<Configuration> needed) {
  // The newest snapshot that was looked at.
  auto seen = std::make_shared<std::atomic<uint64_t>>(snapshot->number());
  auto ended = std::make_shared<std::atomic<bool>>(false);
  return ob::PlannerTerminationCondition([&space, snapshot = std::move(snapshot),
                                          needed = std::move(needed), seen, ended] {
    if (*ended || snapshot->unknown_reason()) return true;
    const auto newest = space.Snapshot();
    if (newest->number() == seen->load()) return false;
    const bool free =
        !newest->unknown_reason() && std::ranges::all_of(needed, [&space](const Configuration& q) {
          return space.CheckMotionOrAsk(q, q).free();
        });
    if (free) {
      seen->store(newest->number());
    } else {
      ended->store(true);
    }
    return !free;
  });
}

ob::OptimizationObjectivePtr MakeClearanceObjective(
    const ob::SpaceInformationPtr& si, std::shared_ptr<const ConfigurationSpace> clearances) {
  return std::make_shared<ClearanceObjective>(si, std::move(clearances));
}

}  // namespace silhouette::client
