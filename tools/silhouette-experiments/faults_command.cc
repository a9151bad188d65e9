// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments faults
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/commands.h"
#include "tools/silhouette-experiments/faults/faults.h"

namespace silhouette {
namespace {

using faults_experiment::FaultRow;
using faults_experiment::WatchResult;
using faults_experiment::WatchSettings;

struct FaultsArguments {
  std::string cell;
  WatchSettings watch;
  std::string format = "text";
};

std::string FaultsTextOf(const WatchResult& result) {
  std::string text = absl::StrFormat(
      "%d scenes, %.2f h: %d false alarms, %.2f an hour, in %d scenes\n", result.scenes,
      result.hours, result.alarms.size(),
      result.hours > 0 ? static_cast<double>(result.alarms.size()) / result.hours : 0.0,
      result.none.found);
  for (const auto& [reason, count] : result.none.reasons) {
    absl::StrAppendFormat(&text, "  %s: %d\n", reason, count);
  }
  for (const std::string& alarm : result.alarms) absl::StrAppend(&text, "  ", alarm, "\n");
  absl::StrAppendFormat(
      &text,
      "nearest to the limits: structure %.2f, shift %.2f px, foreground %.2f, robot missing %.2f, "
      "gain %.2f to %.2f\na view's image takes %.0f us, its proof of life %.0f us\n\n"
      "| fault | found in | by |\n|---|---|---|\n",
      result.least_structure, result.greatest_shift, result.greatest_foreground,
      result.greatest_robot_missing, result.least_gain, result.greatest_gain, result.condition_time,
      result.life_time);
  for (const FaultRow& row : result.faults) {
    absl::StrAppendFormat(&text, "| %s | %d of %d | %s", row.name, row.found, row.tried,
                          absl::StrJoin(row.reasons, ", ", absl::PairFormatter(" ")));
    if (!row.after.empty()) {
      absl::StrAppendFormat(&text, ", after %.1f s of motion (median)", Median(row.after));
    }
    absl::StrAppend(&text, " |\n");
  }
  return text;
}

nlohmann::ordered_json FaultsJsonOf(const WatchResult& result) {
  nlohmann::ordered_json json = {{"scenes", result.scenes},
                                 {"hours", result.hours},
                                 {"false_alarms", result.alarms.size()},
                                 {"alarms", result.alarms},
                                 {"false_alarm_scenes", result.none.found},
                                 {"false_alarms_by_reason", result.none.reasons},
                                 {"condition_us", result.condition_time},
                                 {"life_us", result.life_time}};
  for (const FaultRow& row : result.faults) {
    json["faults"].push_back({{"fault", row.name},
                              {"tried", row.tried},
                              {"found", row.found},
                              {"reasons", row.reasons},
                              {"seconds", row.after}});
  }
  return json;
}

absl::StatusOr<ExitCode> RunFaults(const FaultsArguments& arguments) {
  ASSIGN_OR_RETURN(const auto workplace, cell_experiment::SimulatedWorkplace::Load(arguments.cell));
  RETURN_IF_ERROR(cell_experiment::CheckGridIsStated(workplace.cell()));
  CatchStopSignals();
  Progress progress("scenes", static_cast<uint64_t>(ScenesOf(arguments.watch)), "scenes");
  const WatchResult result = Watch(workplace, arguments.watch, StopRequested,
                                   [&](int done) { progress.Update(static_cast<uint64_t>(done)); });
  PrintResult(arguments.format, FaultsJsonOf(result), FaultsTextOf(result));
  if (StopRequested()) return absl::AbortedError("stopped; the result is of the scenes until then");
  return kDone;
}

}  // namespace

void AddFaultsCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand("faults",
                                             "What the server notices when light, cameras or robot "
                                             "are not as they were, and how often it\n"
                                             "raises a false alarm while people walk about");
  const auto arguments = std::make_shared<FaultsArguments>();
  command->add_option("--cell", arguments->cell, "The file of a simulated cell")->required();
  command->add_option("--minutes", arguments->watch.minutes, "Of simulated time")
      ->check(CLI::Range(0.1, 10000.0))
      ->capture_default_str();
  TakeTimes(command->add_option("--interval", arguments->watch.interval, "From scene to scene"),
            0.01, 100)
      ->capture_default_str();
  command->add_option("--people", arguments->watch.people, "Who walk about")
      ->check(CLI::Range(0, 20))
      ->capture_default_str();
  command->add_option("--seed", arguments->watch.seed, "Of people, light and robot")
      ->capture_default_str();
  AddFormatOption(*command, arguments->format);
  command->footer(
      "Example:\n"
      "  silhouette-experiments faults --cell capture/sim/cells/demo/cell.yaml --minutes 60");
  RunWhenChosen(*command, run, arguments, RunFaults);
}

}  // namespace silhouette
