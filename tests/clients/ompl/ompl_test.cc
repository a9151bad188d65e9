// SPDX-License-Identifier: Apache-2.0
// OMPL's planners on the snapshot of a served cell.
#include "silhouette/ompl.h"

#include <gtest/gtest.h>
#include <ompl/base/goals/GoalState.h>
#include <ompl/base/terminationconditions/IterationTerminationCondition.h>
#include <ompl/geometric/planners/kpiece/LBKPIECE1.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "silhouette/client.h"
#include "tests/clients/cpp/watched_space.h"
#include "tests/random.h"
#include "tests/server/service/test_server.h"

namespace silhouette::client {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;

// A server whose clock runs, and a space that follows it.
struct PlannedCell {
  PlannedCell() { ompl::msg::setLogLevel(ompl::msg::LOG_ERROR); }

  static ServingSettings Settings() {
    ServingSettings settings;
    settings.scene.max_age = absl::Minutes(10);
    return settings;
  }

  std::shared_ptr<const SpaceSnapshot> Show(const SceneInput& input) {
    const uint64_t scene = server.Publish(input).id();
    auto snapshot = space.Snapshot();
    for (int i = 0; i < 100 && snapshot->basis().scene_id != scene; ++i) {
      snapshot = space.WaitForUpdate(snapshot->number(), absl::Seconds(10));
    }
    EXPECT_EQ(snapshot->unknown_reason(), std::nullopt);
    return snapshot;
  }

  TestServer server{NewDatabase({}), Settings(),
                    [](const silhouette::Clock&) { return SystemClock; }};
  Client client = Client::Connect(server.server->address()).value();
  LocalSpace space{client, {.max_age = absl::Minutes(5)}};
};

Configuration RandomPlace(const SpaceSnapshot& snapshot, std::mt19937_64& random) {
  Configuration q;
  do {
    q.clear();
    for (const GridJoint& joint : snapshot.grid()->joints()) {
      q.push_back(std::uniform_real_distribution<double>(joint.lower, joint.upper)(random));
    }
  } while (!snapshot.Check(q).free());
  return q;
}

template <typename Planner>
std::vector<Configuration> PlanWith(const std::shared_ptr<const SpaceSnapshot>& snapshot,
                                    const Configuration& start, const Configuration& goal) {
  const ob::SpaceInformationPtr si = MakeSpaceInformation(snapshot);
  auto problem = std::make_shared<ob::ProblemDefinition>(si);
  problem->setStartAndGoalStates(StateOf(si, start), StateOf(si, goal), 1e-9);
  Planner planner(si);
  planner.setProblemDefinition(problem);
  planner.setup();
  ob::IterationTerminationCondition most(2000);
  if (planner.solve(most) != ob::PlannerStatus::EXACT_SOLUTION) return {};
  return WaypointsOf(*problem->getSolutionPath()->as<og::PathGeometric>(), start);
}

template <typename Planner>
void ExpectPathsThatTheServerAccepts(int problems) {
  Random random;
  PlannedCell cell;
  int found = 0;
  std::shared_ptr<const SpaceSnapshot> snapshot;
  for (int i = 0; i < problems; ++i) {
    if (i % 10 == 0) {
      snapshot = cell.Show(
          SceneWithBlock(static_cast<int>(random() % 5), 1 + static_cast<int>(random() % 2)));
    }
    const Configuration start = RandomPlace(*snapshot, random);
    const Configuration goal = RandomPlace(*snapshot, random);
    const std::vector<Configuration> path = PlanWith<Planner>(snapshot, start, goal);
    if (path.empty()) continue;
    ++found;
    EXPECT_EQ(path.front(), start);
    for (size_t j = 0; j < goal.size(); ++j) {
      const double turn = snapshot->grid()->joints()[j].continuous ? 2 * M_PI : 1e9;
      EXPECT_NEAR(std::remainder(path.back()[j] - goal[j], turn), 0, 1e-6);
    }
    EXPECT_TRUE(IsPathFree(*snapshot, path));
    const auto there = cell.client.CheckPath(path);
    ASSERT_TRUE(there.ok()) << there.status();
    EXPECT_TRUE(there->verdict.free()) << Describe(there->verdict.reason);
  }
  EXPECT_GT(found, problems / 4);
}

TEST(MakeSpaceInformation, RefusesNoSnapshot) {
  EXPECT_THROW(MakeSpaceInformation(nullptr), std::invalid_argument);
}

TEST(Ompl, EveryPathOfRrtConnectIsAcceptedByTheServer) {
  ExpectPathsThatTheServerAccepts<og::RRTConnect>(100);
}

TEST(Ompl, EveryPathOfLbkpieceIsAcceptedByTheServer) {
  ExpectPathsThatTheServerAccepts<og::LBKPIECE1>(100);
}

TEST(Ompl, LastValidStateOfAMotionIsFree) {
  Random random;
  PlannedCell cell;
  const auto snapshot = cell.Show(SceneWithBlock(2, 2));
  const ob::SpaceInformationPtr si = MakeSpaceInformation(snapshot);
  int blocked = 0;
  for (int i = 0; i < 200; ++i) {
    const ob::ScopedState<> from = StateOf(si, RandomPlace(*snapshot, random));
    ob::ScopedState<> to(si);
    to.random();
    ob::ScopedState<> last(si);
    std::pair<ob::State*, double> last_valid{last.get(), -1};
    const bool free = si->checkMotion(from.get(), to.get(), last_valid);
    EXPECT_EQ(free, si->checkMotion(from.get(), to.get()));
    EXPECT_EQ(last_valid.second < 0, free);
    if (free) continue;
    ++blocked;
    EXPECT_TRUE(si->isValid(last.get()));
  }
  EXPECT_GT(blocked, 20);
}

TEST(Ompl, PlanningEndsWhenSomethingIsInTheWayOfStartOrGoal) {
  Random random;
  PlannedCell cell;
  const auto empty = cell.Show(EmptyCellScene());
  const auto blocked = cell.Show(SceneWithBlock(2, 2));
  Configuration start;
  do {
    start = RandomPlace(*empty, random);
  } while (blocked->Check(start).state != State::kOccupied);
  const Configuration elsewhere = RandomPlace(*blocked, random);
  EXPECT_TRUE(UntilSceneChanges(cell.space, empty, {start})());
  EXPECT_FALSE(UntilSceneChanges(cell.space, empty, {elsewhere})());
  EXPECT_FALSE(UntilSceneChanges(cell.space, blocked, {start})()) << "it was so before";
  EXPECT_TRUE(IsPathFree(*empty, std::vector<Configuration>{start}));
  EXPECT_FALSE(IsPathFree(*blocked, std::vector<Configuration>{start, start}));
}

TEST(Ompl, PlanningGoesOnWhileTheServerCallsTheStartFreeThatTheMapDoesNotDecide) {
  std::atomic<bool> free = true;
  std::atomic<int> calls = 0;
  WatchedServer server;  // that knows no GetDatabase: the map decides nothing between grid points
  server.fake.check_path = [&](auto&, auto&, v1::CheckPathResponse& response) {
    ++calls;
    *response.mutable_basis() = BasisOf(2);
    response.mutable_verdict()->set_state(free ? v1::Verdict::STATE_FREE
                                               : v1::Verdict::STATE_OCCUPIED);
    return grpc::Status::OK;
  };
  const LocalSpace space(ClientOfHere(server.fake), {.max_age = absl::Minutes(10)});
  server.Send(FirstUpdate(BasisOf(1)));
  const auto first = space.WaitForUpdate(0, absl::Seconds(20));
  const Configuration start = {0.5, 5.5};
  ASSERT_EQ(first->Check(start).reason, Reason::kBetweenGridPoints);
  const auto changed = UntilSceneChanges(space, first, {start});
  EXPECT_FALSE(changed());
  server.Send(Update(BasisOf(2)));
  const auto second = space.WaitForUpdate(first->number(), absl::Seconds(20));
  ASSERT_GT(second->number(), first->number());
  EXPECT_FALSE(changed());
  free = false;
  server.Send(Update(BasisOf(3)));
  ASSERT_GT(space.WaitForUpdate(second->number(), absl::Seconds(20))->number(), second->number());
  EXPECT_TRUE(changed());
  const int asked = calls;
  free = true;
  EXPECT_TRUE(changed()) << "it has ended";
  EXPECT_EQ(calls, asked);
}

TEST(Ompl, NothingIsValidOnceTheSnapshotExpires) {
  PlannedCell cell;
  const LocalSpace brief(cell.client, {.max_age = absl::Milliseconds(300)});
  Random random;
  cell.Show(EmptyCellScene());
  std::shared_ptr<const SpaceSnapshot> snapshot = brief.Snapshot();
  for (int i = 0; i < 100 && snapshot->grid() == nullptr; ++i) {
    snapshot = brief.WaitForUpdate(snapshot->number(), absl::Seconds(10));
  }
  const ob::SpaceInformationPtr si = MakeSpaceInformation(snapshot);
  const ob::ScopedState<> q = StateOf(si, RandomPlace(*cell.space.Snapshot(), random));
  std::this_thread::sleep_until(snapshot->usable_until());
  EXPECT_FALSE(si->isValid(q.get()));
  EXPECT_FALSE(si->checkMotion(q.get(), q.get()));
  EXPECT_TRUE(UntilSceneChanges(brief, snapshot, {})());
}

// A start beyond the turn, from which half a turn could be taken either way.
TEST(Ompl, WaypointsOfHalfATurnTakeTheWayThatWasChecked) {
  const std::vector<GridJoint> joints = {{"base", -M_PI, M_PI, 8, /*continuous=*/true}};
  const auto space = std::make_shared<JointStateSpace>(joints);
  const auto si = std::make_shared<ob::SpaceInformation>(space);
  for (int degrees = 181; degrees <= 540; ++degrees) {
    const Configuration start = {degrees * M_PI / 180};
    const Configuration goal = {(degrees - 180) * M_PI / 180};
    og::PathGeometric path(si);
    for (const Configuration& q : {start, goal}) path.append(StateOf(si, q).get());
    Configuration from(1);
    Configuration to(1);
    space->GetValues(path.getState(0), from);
    space->GetValuesNear(from, path.getState(1), to);
    const std::vector<Configuration> waypoints = WaypointsOf(path, start);
    EXPECT_NEAR(waypoints[1][0] - waypoints[0][0], to[0] - from[0], 1e-9) << degrees;
  }
}

TEST(Ompl, ContinuousJointAtAnyValueIsInTheTurn) {
  const std::vector<GridJoint> joints = {{"base", -M_PI, M_PI, 8, /*continuous=*/true}};
  const auto space = std::make_shared<JointStateSpace>(joints);
  const auto si = std::make_shared<ob::SpaceInformation>(space);
  for (int degrees = -720; degrees <= 720; degrees += 45) {
    const double value = degrees * M_PI / 180;
    for (const double q : {std::nextafter(value, -100), value, std::nextafter(value, 100)}) {
      const ob::ScopedState<> state = StateOf(si, Configuration{q});
      EXPECT_TRUE(space->satisfiesBounds(state.get())) << degrees;
      Configuration held(1);
      space->GetValues(state.get(), held);
      EXPECT_NEAR(std::remainder(held[0] - q, 2 * M_PI), 0, 1e-12) << degrees;
    }
  }
}

TEST(MakeSpaceInformation, RefusesAPathResolutionThatTheServerRefuses) {
  PlannedCell cell;
  const auto snapshot = cell.Show(EmptyCellScene());
  EXPECT_THROW(MakeSpaceInformation(snapshot, {.path_resolution = 0.2}), std::invalid_argument);
}

TEST(Ompl, StatesHaveOneValuePerJoint) {
  PlannedCell cell;
  const ob::SpaceInformationPtr si = MakeSpaceInformation(cell.Show(EmptyCellScene()));
  EXPECT_THROW(StateOf(si, Configuration{1}), std::invalid_argument);
  const og::PathGeometric path(si);
  EXPECT_THROW(WaypointsOf(path, Configuration{1}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette::client
