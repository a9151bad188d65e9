// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/plan_ompl.h"

#include <ompl/geometric/PathSimplifier.h>
#include <ompl/geometric/planners/kpiece/LBKPIECE1.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>

#include <memory>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "silhouette/local_space.h"
#include "silhouette/ompl.h"

namespace silhouette {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;

constexpr double kLongestSearch = 5;  // seconds

constexpr absl::Duration kNextScene = absl::Seconds(1);

// A snapshot of a scene that is not known to be old, once there is one.
absl::StatusOr<std::shared_ptr<const client::SpaceSnapshot>> UsableSnapshot(
    const LocalSpace& space) {
  auto snapshot = space.Snapshot();
  while (snapshot->unknown_reason() == client::Reason::kNoUpdate && !StopRequested()) {
    snapshot = space.WaitForUpdate(snapshot->number(), absl::Milliseconds(100));
  }
  if (snapshot->unknown_reason()) snapshot = space.WaitForUpdate(snapshot->number(), kNextScene);
  if (StopRequested()) return absl::AbortedError("stopped");
  const absl::Status problem = space.status().problem;
  if (!problem.ok()) return problem;
  if (const auto reason = snapshot->unknown_reason()) {
    return absl::FailedPreconditionError(absl::StrCat("all is unknown: ", Describe(*reason)));
  }
  return snapshot;
}

std::unique_ptr<ob::Planner> PlannerOf(const std::string& name, const ob::SpaceInformationPtr& si) {
  if (name == "lbkpiece") return std::make_unique<og::LBKPIECE1>(si);
  return std::make_unique<og::RRTConnect>(si);
}

// Until `end` is true. Empty: none was found.
std::vector<Configuration> WayByOmpl(const std::string& planner, const ob::SpaceInformationPtr& si,
                                     const Configuration& start, const Configuration& goal,
                                     const ob::PlannerTerminationCondition& end) {
  auto problem = std::make_shared<ob::ProblemDefinition>(si);
  problem->setStartAndGoalStates(client::StateOf(si, start), client::StateOf(si, goal));
  const std::unique_ptr<ob::Planner> search = PlannerOf(planner, si);
  search->setProblemDefinition(problem);
  if (search->solve(end) != ob::PlannerStatus::EXACT_SOLUTION) return {};
  auto& path = *problem->getSolutionPath()->as<og::PathGeometric>();
  og::PathSimplifier(si).reduceVertices(path);
  return client::WaypointsOf(path, start);
}

}  // namespace

absl::StatusOr<std::vector<Configuration>> SearchByOmpl(const Session& session,
                                                        const Client& client,
                                                        const std::string& planner,
                                                        const Configuration& start,
                                                        const Configuration& goal) {
  ompl::msg::setLogLevel(ompl::msg::LOG_ERROR);
  const LocalSpace space(client, {.policy = session.policy, .max_age = absl::InfiniteDuration()});
  ASSIGN_OR_RETURN(auto snapshot, UsableSnapshot(space));
  const ob::PlannerTerminationCondition late =
      ob::plannerOrTerminationCondition(ob::timedPlannerTerminationCondition(kLongestSearch),
                                        ob::PlannerTerminationCondition(StopRequested));
  std::vector<Configuration> way;
  while (true) {
    const auto si = client::MakeSpaceInformation(snapshot, {.ask = &space});
    const auto changed = client::UntilSceneChanges(space, snapshot, {start, goal});
    way = WayByOmpl(planner, si, start, goal, ob::plannerOrTerminationCondition(late, changed));
    if (!way.empty() || !changed() || late()) break;
    ASSIGN_OR_RETURN(snapshot, UsableSnapshot(space));
  }
  if (StopRequested()) return absl::AbortedError("stopped");
  return way;
}

}  // namespace silhouette
