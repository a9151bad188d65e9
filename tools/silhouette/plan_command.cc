// SPDX-License-Identifier: Apache-2.0
// silhouette plan
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/planners/path_search.h"
#include "common/numbers/numbers.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/inputs.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/formats/pictures.h"
#include "tools/silhouette/formats/truth.h"
#include "tools/silhouette/plan_motions.h"

namespace silhouette {
namespace {

struct PlanArguments {
  std::string start;
  std::string goal;
  std::string planner;  // empty: wave, or trees for a drawn robot
  bool diagonal = false;
  std::string out;
  std::string picture;
  std::string truth;
};

// All that is found out, step by step.
struct Findings {
  client::ConfigurationSpace space;
  double space_ms = 0;
  Configuration start;
  Configuration goal;
  client::Verdict at_start;
  client::Verdict at_goal;
  PathSearch search;
  // Of the whole path, if one was found.
  std::optional<client::PathCheck> check;
  std::optional<Truth> truth;

  bool found() const { return check && check->verdict.free(); }
};

// Why there is no path; that there is one.
std::string OutcomeText(const Findings& findings) {
  const PlanOutcome outcome = findings.search.plan.outcome;
  const client::Basis& basis = findings.space.basis();
  if (outcome == PlanOutcome::kStartBlocked && !findings.at_start.free()) {
    return BlockedEnd("start", findings.at_start, basis);
  }
  if (outcome == PlanOutcome::kGoalBlocked && !findings.at_goal.free()) {
    return BlockedEnd("goal", findings.at_goal, basis);
  }
  if (findings.check && !findings.check->verdict.free()) return BlockedPath(*findings.check);
  if (findings.search.unknown) {
    return absl::StrCat("while it was planned, verdicts became ",
                        Spoken(*findings.search.unknown, basis));
  }
  return Describe(outcome);
}

absl::StatusOr<Findings> FindPath(const Session& session, const Client& client,
                                  const Configuration& start, const Configuration& goal,
                                  bool diagonal) {
  const client::Policy& policy = session.policy;
  const auto begin = std::chrono::steady_clock::now();
  auto space = client.GetConfigurationSpace(policy);
  const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - begin;
  if (!space.ok()) return space.status();
  ASSIGN_OR_RETURN(const auto ends, client.CheckConfigurations({start, goal}, policy));
  ASSIGN_OR_RETURN(const auto search,
                   SearchPath(client, policy, *space, start, ends.verdicts[0].free(), goal,
                              ends.verdicts[1].free(), diagonal ? Moves::kDiagonals : Moves::kAxes,
                              StopRequested));
  Findings findings{.space = *std::move(space),
                    .space_ms = taken.count(),
                    .start = start,
                    .goal = goal,
                    .at_start = ends.verdicts[0],
                    .at_goal = ends.verdicts[1],
                    .search = search,
                    .check = std::nullopt,
                    .truth = std::nullopt};
  if (search.plan.found()) {
    ASSIGN_OR_RETURN(auto check, client.CheckPath(search.plan.waypoints, policy));
    findings.check = std::move(check);
  }
  return findings;
}

absl::Status WritePath(const Findings& findings, const std::string& path) {
  Json json = PathFileOf(findings.space.grid().joints(), OutcomeText(findings),
                         findings.search.plan.waypoints, findings.check);
  if (findings.found()) json["length_steps"] = findings.search.plan.length;
  return WriteWholeFile(path, json.dump(2) + "\n");
}

std::string PlanTitleOf(const Findings& findings) {
  std::string title = "Configuration space, ";
  absl::StrAppend(&title, findings.found() ? "planned path" : "no path");
  if (!findings.truth) return title;
  const Judgement judgement = Judge(findings.space, *findings.truth);
  absl::StrAppend(&title, "; missing ", judgement.missing, ", additional ", judgement.additional,
                  " of ", judgement.configurations);
  return title;
}

absl::Status PlanWritePicture(const Findings& findings,
                              const std::vector<std::optional<bool>>& slides,
                              const std::string& path) {
  const ConfigurationGrid& grid = findings.space.grid();
  ASSIGN_OR_RETURN(auto chart, ChartOf(findings.space, slides, PlanTitleOf(findings)));
  if (findings.truth) {
    for (int y = 0; y < chart.y.cells; ++y) {
      for (int x = 0; x < chart.x.cells; ++x) {
        chart.outlined.push_back(findings.truth->Contact(grid.NumberOf({x, y})) ? 1 : 0);
      }
    }
    chart.outline.text = "truth: contact inside";
  }
  const ChartedJoints charted{.grid = grid, .slides = slides};
  chart.start = ChartPointOf(charted, findings.start);
  chart.goal = ChartPointOf(charted, findings.goal);
  if (findings.found()) chart.path = ChartLines(charted, findings.search.plan.waypoints);
  return WritePng(path, Draw(chart));
}

Json PlanJsonOf(const Findings& findings) {
  const client::StateCounts counts = findings.space.Count();
  const Plan& plan = findings.search.plan;
  Json json{
      {"found", findings.found()},
      {"outcome", OutcomeText(findings)},
      {"path_waypoints", findings.found() ? plan.waypoints.size() : 0},
      {"length_steps", plan.length},
      {"places_checked", findings.check ? Json(findings.check->checked) : Json()},
      {"hidden_possible", findings.check ? Json(findings.check->verdict.hidden_possible) : Json()},
      {"waves", findings.search.rounds},
      {"blocked_moves", findings.search.blocked_moves}};
  json.update(JsonOf(findings.check ? findings.check->basis : findings.space.basis()));
  json.update({{"space_ms", findings.space_ms},
               {"configurations", findings.space.grid().size()},
               {"free", counts.free},
               {"occupied", counts.occupied},
               {"unknown", counts.unknown}});
  if (findings.truth) {
    const Judgement judgement = Judge(findings.space, *findings.truth);
    const uint64_t all = judgement.configurations;
    json.update({{"occupied_in_truth", judgement.occupied_in_truth},
                 {"occupied_in_truth_percent", Percent(judgement.occupied_in_truth, all)},
                 {"missing", judgement.missing},
                 {"missing_percent", Percent(judgement.missing, all)},
                 {"additional", judgement.additional},
                 {"additional_percent", Percent(judgement.additional, all)}});
  }
  return json;
}

std::string PlanTextOf(const Session& session, TypedJoints& joints, const Findings& findings) {
  const Plan& plan = findings.search.plan;
  std::string text;
  if (findings.found()) {
    text = absl::StrFormat("a path of %d waypoints, %.4g grid steps long\n", plan.waypoints.size(),
                           plan.length);
    for (const Configuration& q : plan.waypoints) absl::StrAppend(&text, "  ", Spoken(q), "\n");
    absl::StrAppend(&text, Spoken(*findings.check), ", ", Spoken(findings.check->basis), "\n");
  } else {
    text = absl::StrCat("no path: ", OutcomeText(findings),
                        UnitHint(session, joints, {findings.start, findings.goal}), "\n");
  }
  if (!findings.truth) return text;
  const Judgement judgement = Judge(findings.space, *findings.truth);
  const uint64_t all = judgement.configurations;
  absl::StrAppendFormat(
      &text,
      "against the truth, of %d configurations: %d (%.2f %%) really occupied; missing (reported "
      "free, really occupied) %d (%.2f %%); additional (reported occupied, really free) %d "
      "(%.2f %%); unknown %d\n",
      all, judgement.occupied_in_truth, Percent(judgement.occupied_in_truth, all),
      judgement.missing, Percent(judgement.missing, all), judgement.additional,
      Percent(judgement.additional, all), judgement.unknown);
  return text;
}

absl::StatusOr<ExitCode> PlanAndPrint(const Session& session, const PlanArguments& arguments) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  CatchStopSignals();
  ASSIGN_OR_RETURN(const auto database, client.GetDatabase());
  const bool drawn = database.images() == "drawn";
  const std::string planner = !arguments.planner.empty() ? arguments.planner
                              : drawn                    ? "trees"
                                                         : "wave";
  if (drawn && planner == "wave") {
    return absl::InvalidArgumentError(
        "--planner wave needs the configuration space of a grid, and the robot images of this cell "
        "are drawn: use rrtconnect or lbkpiece");
  }
  TypedJoints joints(session.unit, [&] { return database; });
  ASSIGN_OR_RETURN(const Configuration start, joints.Parse(arguments.start));
  ASSIGN_OR_RETURN(const Configuration goal, joints.Parse(arguments.goal));
  if (planner != "wave") {
    if (!arguments.picture.empty() || !arguments.truth.empty() || arguments.diagonal) {
      return absl::InvalidArgumentError(absl::StrCat(
          "--picture, --truth and --diagonal need the configuration space of a grid, and ",
          drawn ? "the robot images of this cell are drawn" : absl::StrCat(planner, " uses none"),
          ": plan without them"));
    }
    return PlanByMotions(session, client, database, planner, start, goal, arguments.out);
  }
  ASSIGN_OR_RETURN(Findings findings, FindPath(session, client, start, goal, arguments.diagonal));
  if (!arguments.truth.empty()) {
    ASSIGN_OR_RETURN(auto truth, Truth::Read(arguments.truth, findings.space.grid()));
    findings.truth = std::move(truth);
  }
  absl::Status status;
  if (!arguments.out.empty()) status = WritePath(findings, arguments.out);
  if (!arguments.picture.empty())
    status.Update(PlanWritePicture(findings, joints.Slides(), arguments.picture));
  if (!status.ok()) return status;
  PrintResult(session.format, PlanJsonOf(findings), PlanTextOf(session, joints, findings));
  return findings.found() ? kDone : kNo;
}

// However it ends, no path of an earlier plan is left in the file. A pipe holds none.
absl::StatusOr<ExitCode> PlanPath(const Session& session, const PlanArguments& arguments) {
  std::error_code ignored;
  if (!arguments.out.empty() && !std::filesystem::is_other(arguments.out, ignored)) {
    const Json path = PathFileOf({}, "planning did not end, or ended with an error", {}, {});
    const absl::Status written = WriteWholeFile(arguments.out, path.dump(2) + "\n");
    // A full disk, on which the file stays as it was, lets it be emptied.
    if (!written.ok()) std::filesystem::resize_file(arguments.out, 0, ignored);
    RETURN_IF_ERROR(written);
  }
  return PlanAndPrint(session, arguments);
}

}  // namespace

void AddPlanCommand(CLI::App& program, Session& session) {
  CLI::App* command = program.add_subcommand(
      "plan",
      "Plan a path, by default by wave propagation on the configuration space, and check it");
  auto arguments = std::make_shared<PlanArguments>();
  command->add_option("start", arguments->start, "Joint values with commas between them")
      ->required();
  command->add_option("goal", arguments->goal, "Joint values with commas between them")->required();
  AddDegreesFlag(*command, session);
  command
      ->add_option("--planner", arguments->planner,
                   "wave (default of a grid), or OMPL's rrtconnect or lbkpiece")
      ->check(CLI::IsMember({"wave", "rrtconnect", "lbkpiece"}));
  command->add_flag("--diagonal", arguments->diagonal, "Move several joints at once (wave)");
  command->add_option("--out", arguments->out,
                      "Write the path as JSON: configurations under the key \"waypoints\",\n"
                      "none if there is no path, or after an error");
  AddPictureOption(*command, arguments->picture,
                   "Draw configuration space and path as a PNG, for grids of two joints");
  command->add_option("--truth", arguments->truth,
                      "What silhouette-sim truth wrote: judge the configuration space by it");
  AddVerdictOptions(*command, session);
  command->footer(
      "Unknown counts as occupied. On a continuous joint the path goes on beyond the turn.\n"
      "A robot whose images are drawn has no grid: two trees of motions grow from start and goal,\n"
      "and the server checks each (RRT-Connect). A joint stays within the range of its values "
      "then.\n"
      "OMPL's planners check motions in the client, and ask the server where it does not know.\n"
      "Exit code 0 if there is a path, 1 if not, 130 if Ctrl-C ended the search.\n\n"
      "Example:\n"
      "  silhouette plan -100deg,70deg 100deg,70deg --out path.json \\\n"
      "      --picture configuration-space.png");
  Runs(*command, session, PlanPath, arguments);
}

}  // namespace silhouette
