// SPDX-License-Identifier: Apache-2.0
// Plans a path from one configuration to another: plan_path ADDRESS START GOAL, joint values in
// radians with commas between them. Prints its waypoints.
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <silhouette/ompl.h>

#include <iostream>
#include <sstream>
#include <string>

namespace ob = ompl::base;
namespace og = ompl::geometric;

silhouette::Configuration Parse(const std::string& text) {
  silhouette::Configuration q;
  std::istringstream in(text);
  for (std::string value; std::getline(in, value, ',');) q.push_back(std::stod(value));
  return q;
}

int Plan(const std::string& address, const silhouette::Configuration& start,
         const silhouette::Configuration& goal) {
  const auto client = silhouette::Client::Connect(address);
  if (!client.ok()) {
    std::cerr << client.status().message() << '\n';
    return 2;
  }
  const silhouette::LocalSpace space(*client);
  auto snapshot = space.Snapshot();
  while (snapshot->grid() == nullptr && space.status().problem.ok()) {
    snapshot = space.WaitForUpdate(snapshot->number(), absl::Seconds(1));
  }
  if (const auto reason = snapshot->unknown_reason()) {
    std::cerr << "unknown: " << Describe(*reason) << '\n';
    return 3;
  }
  const auto si = silhouette::client::MakeSpaceInformation(snapshot);
  auto problem = std::make_shared<ob::ProblemDefinition>(si);
  problem->setStartAndGoalStates(silhouette::client::StateOf(si, start),
                                 silhouette::client::StateOf(si, goal));
  og::RRTConnect planner(si);
  planner.setProblemDefinition(problem);
  const auto end = ob::plannerOrTerminationCondition(
      ob::timedPlannerTerminationCondition(5),
      silhouette::client::UntilSceneChanges(space, snapshot, {start, goal}));
  if (planner.solve(end) != ob::PlannerStatus::EXACT_SOLUTION) {
    std::cerr << "no path was found\n";
    return 1;
  }
  const auto& path = *problem->getSolutionPath()->as<og::PathGeometric>();
  for (const auto& q : silhouette::client::WaypointsOf(path, start)) {
    for (const double value : q) std::cout << value << ' ';
    std::cout << '\n';
  }
  return 0;
}

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  try {
    return Plan(argv[1], Parse(argv[2]), Parse(argv[3]));
  } catch (const std::invalid_argument& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
}
