// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments placement
#include <algorithm>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"
#include "common/parallel/parallel.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/commands.h"
#include "tools/silhouette-experiments/placement/places.h"
#include "tools/silhouette-experiments/placement/trials.h"

namespace silhouette {
namespace {

struct PlacementArguments {
  std::string cell;
  std::string places;
  int cameras = 0;  // 0: what the file says
  std::string preset = "calibrated";
  std::string out;
  std::string format = "text";
};

struct Result {
  Places places;
  Policy policy;
  std::vector<int> usable;
  std::vector<Eigen::Vector2d> footprint;
  std::vector<Selection> selections;

  const Candidate& CandidateOf(int camera) const {
    return places.candidates[static_cast<size_t>(usable[static_cast<size_t>(camera)])];
  }
  size_t unusable() const { return places.candidates.size() - usable.size(); }
};

// Sets to be looked at if every size needs two rounds of exchange: what progress is measured by.
uint64_t ExpectedSets(size_t candidates, int count) {
  uint64_t sets = 0;
  for (size_t size = 1; size <= static_cast<size_t>(count) && size <= candidates; ++size) {
    sets += candidates - size + 1;
    if (size > 1) sets += 2 * size * (candidates - size);
  }
  return sets;
}

// Where configurations are sampled: the cell's grid, or a fine one within the joints' limits if its
// file states none.
ConfigurationGrid GridToSample(const Cell& cell) {
  constexpr int kSteps = 32;
  if (StatesAGrid(cell)) return cell.grid;
  std::vector<GridJoint> joints(cell.grid.joints().begin(), cell.grid.joints().end());
  for (GridJoint& joint : joints) joint.steps = joint.lower < joint.upper ? kSteps : 1;
  return ConfigurationGrid(std::move(joints));
}

absl::StatusOr<Trials> MakeTrials(const Cell& cell, const RobotModel& robot, const Places& places) {
  std::vector<std::string> names;
  for (const GridJoint& joint : cell.grid.joints()) names.push_back(joint.name);
  for (const FixedJoint& joint : cell.fixed_joints) names.push_back(joint.name);
  const PositionsAt positions_at = [&](const Configuration& q) {
    std::vector<double> values = q;
    for (const FixedJoint& joint : cell.fixed_joints) values.push_back(joint.position);
    return robot.Positions(names, values);
  };
  std::mutex mutex;
  std::unique_ptr<Progress> progress;
  const auto on_progress = [&](uint64_t done, uint64_t total) {
    const std::lock_guard lock(mutex);
    if (progress == nullptr) progress = std::make_unique<Progress>("drawing", total, "pictures");
    progress->Update(done);
    return !StopRequested();
  };
  return Trials::Make(robot, GridToSample(cell), positions_at, places, on_progress);
}

absl::StatusOr<Result> Choose(const PlacementArguments& arguments) {
  ASSIGN_OR_RETURN(const Cell cell, LoadCell(arguments.cell));
  if (cell.robot.model == nullptr) {
    return absl::InvalidArgumentError(arguments.cell +
                                      ": the robot has no 'urdf', so there is nothing to look at");
  }
  const RobotModel& robot = *cell.robot.model;
  ASSIGN_OR_RETURN(Places places, LoadPlaces(arguments.places));
  if (arguments.cameras > 0) places.cameras = arguments.cameras;
  Result result{
      .places = std::move(places), .policy = {}, .usable = {}, .footprint = {}, .selections = {}};
  result.policy.preset = *PresetFromName(arguments.preset);

  CatchStopSignals();
  ASSIGN_OR_RETURN(const Trials trials, MakeTrials(cell, robot, result.places));
  result.usable = trials.usable();
  result.footprint = trials.footprint();
  const int count = std::min(result.places.cameras, static_cast<int>(result.usable.size()));
  Progress progress("choosing", ExpectedSets(result.usable.size(), count), "sets of cameras");
  std::mutex mutex;
  uint64_t done = 0;
  const auto evaluate = [&](const std::vector<CameraSet>& sets) {
    std::vector<Measures> measures(sets.size());
    ParallelWhile(sets.size(), [&](size_t i) {
      if (StopRequested()) return false;
      measures[i] = trials.MeasuresOf(sets[i], result.policy);
      const std::lock_guard lock(mutex);
      progress.Update(++done);
      return true;
    });
    return measures;
  };
  result.selections =
      Select(static_cast<int>(result.usable.size()), count, evaluate, StopRequested);
  if (StopRequested()) return absl::AbortedError("stopped; start it again to have a result");
  for (Selection& selection : result.selections) {
    selection.measures =
        trials.MeasuresOf(selection.cameras, result.policy, Trials::Scenes::kFresh);
  }
  return result;
}

nlohmann::ordered_json PointJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

nlohmann::ordered_json PlacementJsonOf(const Result& result) {
  using Json = nlohmann::ordered_json;
  Json rows = Json::array();
  for (const Selection& selection : result.selections) {
    Json names = Json::array();
    for (int camera : selection.cameras) names.push_back(result.CandidateOf(camera).name);
    const Measures& m = selection.measures;
    rows.push_back({{"cameras", selection.cameras.size()},
                    {"places", names},
                    {"tested", m.tested},
                    {"occupied_percent", Percent(m.occupied, m.tested)},
                    {"missing", m.missing},
                    {"missing_percent", Percent(m.missing, m.tested)},
                    {"additional", m.additional},
                    {"additional_percent", Percent(m.additional, m.tested)}});
  }
  Json chosen = Json::array();
  for (int camera : result.selections.back().cameras) {
    const Candidate& candidate = result.CandidateOf(camera);
    chosen.push_back({{"name", candidate.name},
                      {"position", PointJson(candidate.position)},
                      {"look_at", PointJson(candidate.look_at)}});
  }
  return {{"preset", NameOf(result.policy.preset)},
          {"candidates", result.places.candidates.size()},
          {"robot_not_whole", result.unusable()},
          {"selections", rows},
          {"chosen", chosen}};
}

std::string PlacementTextOf(const Result& result) {
  const Measures& any = result.selections.back().measures;
  std::string text = absl::StrFormat(
      "%d places; in %d of them the robot is not whole in the image (they are left out)\n"
      "%d fresh scenes, %d configurations each; %.2f %% really occupied; preset %s\n\n"
      "cameras  missing %%  additional %%  places\n",
      result.places.candidates.size(), result.unusable(), result.places.samples.scenes,
      any.tested / result.places.samples.scenes, Percent(any.occupied, any.tested),
      NameOf(result.policy.preset));
  for (const Selection& selection : result.selections) {
    std::string names;
    for (int camera : selection.cameras) {
      absl::StrAppend(&names, names.empty() ? "" : ", ", result.CandidateOf(camera).name);
    }
    const Measures& m = selection.measures;
    absl::StrAppendFormat(&text, "%7d  %9.4f  %12.3f  %s\n", selection.cameras.size(),
                          Percent(m.missing, m.tested), Percent(m.additional, m.tested), names);
  }
  return text;
}

// What tools/plot draws: the table, and all places and the robot from above; metres and radians.
nlohmann::ordered_json MapOf(const Result& result) {
  nlohmann::ordered_json map = PlacementJsonOf(result);
  map["field_of_view"] = result.places.field_of_view;
  auto& places = map["places"] = nlohmann::ordered_json::array();
  for (size_t i = 0; i < result.places.candidates.size(); ++i) {
    const Candidate& candidate = result.places.candidates[i];
    const bool whole = std::ranges::count(result.usable, static_cast<int>(i)) > 0;
    places.push_back({{"name", candidate.name},
                      {"position", PointJson(candidate.position)},
                      {"look_at", PointJson(candidate.look_at)},
                      {"robot_whole", whole}});
  }
  auto& footprint = map["footprint"] = nlohmann::ordered_json::array();
  for (const Eigen::Vector2d& point : result.footprint) footprint.push_back({point.x(), point.y()});
  return map;
}

absl::StatusOr<ExitCode> RunPlacement(const PlacementArguments& arguments) {
  ASSIGN_OR_RETURN(const auto result, Choose(arguments));
  if (!arguments.out.empty()) {
    RETURN_IF_ERROR(WriteWholeFile(arguments.out + "/placement.json", MapOf(result).dump() + "\n"));
  }
  PrintResult(arguments.format, PlacementJsonOf(result), PlacementTextOf(result));
  return kDone;
}

}  // namespace

void AddPlacementCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "placement",
      "Where to put the cameras: of all places where some could be mounted, those from which the\n"
      "fewest configurations are missing (reported free, really occupied), then the fewest\n"
      "additional (reported occupied, really free)");
  const auto arguments = std::make_shared<PlacementArguments>();
  command->add_option("--cell", arguments->cell, "The cell's file: robot and grid")->required();
  command->add_option("--places", arguments->places, "The places' file, places.yaml")->required();
  command->add_option("--cameras", arguments->cameras, "How many; default: what the file says")
      ->check(CLI::Range(1, 8));
  command
      ->add_option("--preset", arguments->preset,
                   "Whose verdicts are judged; the sound presets cannot be")
      ->check(CLI::IsMember({"uncalibrated", "paper", "calibrated", "paper-calibrated"}))
      ->capture_default_str();
  command->add_option("--out", arguments->out,
                      "A folder for placement.json, of which tools/plot draws the cell from above");
  AddFormatOption(*command, arguments->format);
  command->footer(
      "Obstacles, configurations and the robot's present one are sampled; the truth is exact\n"
      "contact; the images are silhouettes without noise or lens distortion. The figures are of\n"
      "fresh scenes, as many as those by which the cameras are chosen.\n\n"
      "Example:\n"
      "  silhouette-experiments placement --cell cell.yaml --places places.yaml --out out");
  RunWhenChosen(*command, run, arguments, RunPlacement);
}

}  // namespace silhouette
