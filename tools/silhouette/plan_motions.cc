// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/plan_motions.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/planners/joint_search.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "silhouette/messages.h"
#include "tools/silhouette/plan_ompl.h"

namespace silhouette {
namespace {

// What was found.
struct MotionPlan {
  std::string planner;
  client::ConfigurationChecks ends;
  JointSearch search;
  double search_ms = 0;
  std::optional<client::PathCheck> check;  // of the whole path, if one was found

  bool found() const { return check && check->verdict.free(); }
};

// Whether a defect of the scene, or its absence, is the reason: the start may be unknown, too.
bool ConcernsTheScene(const client::PathCheck& check) {
  return std::ranges::any_of(check.basis.defects, [&](const client::Defect& defect) {
    return defect.reason == check.verdict.reason;
  });
}

// Fills in plan.search. Without waypoints where start or goal became unknown meanwhile; plan.ends
// says so then.
absl::Status SearchByTrees(const Session& session, const Client& client,
                           const std::vector<GridJoint>& joints, const Configuration& start,
                           const Configuration& goal, MotionPlan& plan) {
  const auto is_free = [&](const Configuration& from,
                           const Configuration& to) -> absl::StatusOr<bool> {
    ++plan.search.checks;
    const std::vector<Configuration> motion = {from, to};
    ASSIGN_OR_RETURN(const auto check, client.CheckPath(motion, session.policy));
    if (ConcernsTheScene(check)) {
      ASSIGN_OR_RETURN(plan.ends, client.CheckConfigurations({start, goal}, session.policy));
    }
    return check.verdict.free();
  };
  const auto ended = [&] { return StopRequested() || !plan.ends.AllFree(); };
  auto search = SearchJoints(joints, start, goal, {}, is_free, ended);
  if (!plan.ends.AllFree()) return absl::OkStatus();
  ASSIGN_OR_RETURN(plan.search, std::move(search));
  return absl::OkStatus();
}

absl::StatusOr<MotionPlan> FindByMotions(const Session& session, const Client& client,
                                         const std::string& planner,
                                         const std::vector<GridJoint>& joints,
                                         const Configuration& start, const Configuration& goal) {
  MotionPlan plan;
  plan.planner = planner;
  ASSIGN_OR_RETURN(plan.ends, client.CheckConfigurations({start, goal}, session.policy));
  if (!plan.ends.AllFree()) return plan;
  const auto begin = std::chrono::steady_clock::now();
  if (planner == "trees") {
    RETURN_IF_ERROR(SearchByTrees(session, client, joints, start, goal, plan));
  } else {
    ASSIGN_OR_RETURN(plan.search.waypoints, SearchByOmpl(session, client, planner, start, goal));
  }
  const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - begin;
  plan.search_ms = taken.count();
  if (plan.search.waypoints.empty()) return plan;
  ASSIGN_OR_RETURN(auto check, client.CheckPath(plan.search.waypoints, session.policy));
  plan.check = std::move(check);
  return plan;
}

// Why there is no path; that there is one.
std::string MotionOutcome(const MotionPlan& plan) {
  for (size_t i = 0; i < 2; ++i) {
    if (plan.ends.verdicts[i].free()) continue;
    return BlockedEnd(i == 0 ? "start" : "goal", plan.ends.verdicts[i], plan.ends.basis);
  }
  if (!plan.check) {
    return absl::StrFormat("none was found by %s in %.0f ms; there may be one all the same",
                           plan.planner, plan.search_ms);
  }
  return plan.found() ? "found" : BlockedPath(*plan.check);
}

// `hint` follows the reason why there is none.
std::string MotionPlanText(const MotionPlan& plan, const std::string& hint) {
  if (!plan.found()) return absl::StrCat("no path: ", MotionOutcome(plan), hint, "\n");
  std::string text = absl::StrFormat("a path of %d waypoints, found by %s in %.3g ms\n",
                                     plan.search.waypoints.size(), plan.planner, plan.search_ms);
  for (const Configuration& q : plan.search.waypoints)
    absl::StrAppend(&text, "  ", Spoken(q), "\n");
  return absl::StrCat(text, Spoken(*plan.check), ", ", Spoken(plan.check->basis), "\n");
}

}  // namespace

std::string BlockedEnd(const std::string& end, const client::Verdict& verdict,
                       const client::Basis& basis) {
  return absl::StrCat("the ", end, " is ", Spoken(verdict, basis));
}

std::string BlockedPath(const client::PathCheck& check) {
  const std::string at =
      check.configuration.empty() ? "" : absl::StrCat(" at ", Spoken(check.configuration));
  return absl::StrCat("the path found is not free", at, ": ", Spoken(check.verdict, check.basis),
                      "; has the scene changed? plan again");
}

Json PathFileOf(std::span<const GridJoint> joints, const std::string& outcome,
                const std::vector<Configuration>& waypoints,
                const std::optional<client::PathCheck>& check) {
  Json names = Json::array();
  for (const GridJoint& joint : joints) names.push_back(joint.name);
  Json json{{"joints", names}, {"outcome", outcome}, {"waypoints", Json::array()}};
  if (!check || !check->verdict.free()) return json;
  json.update({{"waypoints", waypoints},
               {"scene_id", check->basis.scene_id},
               {"database_generation", check->basis.database_generation}});
  return json;
}

absl::StatusOr<ExitCode> PlanByMotions(const Session& session, const Client& client,
                                       const v1::GetDatabaseResponse& database,
                                       const std::string& planner, const Configuration& start,
                                       const Configuration& goal, const std::string& out) {
  ASSIGN_OR_RETURN(const ConfigurationGrid grid, client::FromMessage(database.grid()));
  const std::vector<GridJoint> joints(grid.joints().begin(), grid.joints().end());
  ASSIGN_OR_RETURN(const MotionPlan plan,
                   FindByMotions(session, client, planner, joints, start, goal));
  if (!out.empty()) {
    const Json path = PathFileOf(joints, MotionOutcome(plan), plan.search.waypoints, plan.check);
    RETURN_IF_ERROR(WriteWholeFile(out, path.dump(2) + "\n"));
  }
  Json json{{"found", plan.found()},
            {"outcome", MotionOutcome(plan)},
            {"path_waypoints", plan.found() ? plan.search.waypoints.size() : 0},
            {"planner", plan.planner},
            {"motions_checked", planner == "trees" ? Json(plan.search.checks) : Json()},
            {"search_ms", plan.search_ms},
            {"places_checked", plan.check ? Json(plan.check->checked) : Json()},
            {"hidden_possible", plan.check ? Json(plan.check->verdict.hidden_possible) : Json()}};
  json.update(JsonOf(plan.check ? plan.check->basis : plan.ends.basis));
  TypedJoints typed(session.unit, [&] { return database; });
  PrintResult(session.format, json, MotionPlanText(plan, UnitHint(session, typed, {start, goal})));
  return plan.found() ? kDone : kNo;
}

}  // namespace silhouette
