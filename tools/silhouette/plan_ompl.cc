// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/plan_ompl.h"

#include <ompl/geometric/PathSimplifier.h>
#include <ompl/geometric/planners/kpiece/LBKPIECE1.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>

#include <memory>

#include "absl/strings/str_cat.h"
#include "silhouette/local_space.h"
#include "silhouette/ompl.h"

namespace silhouette {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;

constexpr double kLongestSearch = 5;  // seconds

// The first snapshot of a scene.
absl::StatusOr<std::shared_ptr<const client::SpaceSnapshot>> FirstSnapshot(
    const LocalSpace& space) {
  auto snapshot = space.Snapshot();
  while (snapshot->unknown_reason() == client::Reason::kNoUpdate && !StopRequested()) {
    snapshot = space.WaitForUpdate(snapshot->number(), absl::Milliseconds(100));
  }
  if (StopRequested()) return absl::AbortedError("stopped");
  const absl::Status problem = space.status().problem;
  if (!problem.ok()) return problem;
  if (const auto reason = snapshot->unknown_reason()) {
    return absl::FailedPreconditionError(absl::StrCat("all is unknown: ", Describe(*reason)));
  }
  return snapshot;
}

}  // namespace

absl::StatusOr<std::vector<Configuration>> SearchByOmpl(const Session& session,
                                                        const Client& client,
                                                        const std::string& planner,
                                                        const Configuration& start,
                                                        const Configuration& goal) {
  ompl::msg::setLogLevel(ompl::msg::LOG_ERROR);
  const LocalSpace space(client, {.policy = session.policy, .max_age = absl::InfiniteDuration()});
  const auto snapshot = FirstSnapshot(space);
  if (!snapshot.ok()) return snapshot.status();
  const auto si = client::MakeSpaceInformation(*snapshot, {.ask = &space});
  auto problem = std::make_shared<ob::ProblemDefinition>(si);
  problem->setStartAndGoalStates(client::StateOf(si, start), client::StateOf(si, goal));
  std::unique_ptr<ob::Planner> search;
  if (planner == "lbkpiece") {
    search = std::make_unique<og::LBKPIECE1>(si);
  } else {
    search = std::make_unique<og::RRTConnect>(si);
  }
  search->setProblemDefinition(problem);
  const auto end =
      ob::plannerOrTerminationCondition(ob::timedPlannerTerminationCondition(kLongestSearch),
                                        ob::PlannerTerminationCondition(StopRequested));
  const bool found = search->solve(end) == ob::PlannerStatus::EXACT_SOLUTION;
  if (StopRequested()) return absl::AbortedError("stopped");
  if (!found) return std::vector<Configuration>();
  auto& path = *problem->getSolutionPath()->as<og::PathGeometric>();
  og::PathSimplifier(si).reduceVertices(path);
  std::vector<Configuration> waypoints = client::WaypointsOf(path, start);
  return waypoints;
}

}  // namespace silhouette
