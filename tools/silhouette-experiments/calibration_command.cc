// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments calibration
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/calibration/trials.h"
#include "tools/silhouette-experiments/commands.h"

namespace silhouette {
namespace {

using calibration_experiment::Bar;
using calibration_experiment::Bars;
using calibration_experiment::Figures;
using calibration_experiment::Spread;

// A single calibration's errors have a few common causes: their chi2 says little.
constexpr int kCalibrations = 16;

struct CalibrationArguments {
  int runs = 5;
  uint64_t seed = 1;
  std::string format = "text";
};

absl::StatusOr<Figures> CalibrationMeasure(uint64_t seed) {
  Figures figures = calibration_experiment::MeasureCorners(seed);
  for (const absl::StatusOr<Figures>& more :
       {calibration_experiment::MeasureRoundTrip(seed),
        calibration_experiment::MeasureLenses(seed, kCalibrations),
        calibration_experiment::MeasureFlange(seed)}) {
    if (!more.ok()) {
      return absl::Status(more.status().code(),
                          absl::StrCat("seed ", seed, ": ", more.status().message()));
    }
    figures.insert(more->begin(), more->end());
  }
  return figures;
}

absl::StatusOr<std::vector<Figures>> MeasureAll(const CalibrationArguments& arguments) {
  CatchStopSignals();
  std::vector<Figures> runs;
  Progress progress("calibrating", static_cast<uint64_t>(arguments.runs), "runs");
  for (int run = 0; run < arguments.runs; ++run) {
    if (StopRequested()) return absl::AbortedError("stopped; start it again to have a result");
    ASSIGN_OR_RETURN(const auto figures,
                     CalibrationMeasure(arguments.seed + static_cast<uint64_t>(run)));
    runs.push_back(figures);
    progress.Update(static_cast<uint64_t>(run) + 1);
  }
  return runs;
}

bool Measured(const Bar& bar, const std::vector<Figures>& runs) {
  return std::any_of(runs.begin(), runs.end(),
                     [&](const Figures& figures) { return figures.contains(bar.name); });
}

std::string CalibrationTextOf(const std::vector<Figures>& runs) {
  std::string text =
      absl::StrFormat("%-21s %10s %10s %10s  %s\n", "figure", "median", "worst", "at most", "what");
  for (const Bar& bar : Bars()) {
    if (!Measured(bar, runs)) continue;
    const Spread spread = SpreadOf(bar, runs);
    absl::StrAppendFormat(&text, "%-21s %10.4g %10.4g %10g  %s%s\n", bar.name, spread.median,
                          spread.worst, bar.at_most, bar.meaning,
                          Passes(bar, spread) ? "" : " (MISSED)");
  }
  return text;
}

nlohmann::ordered_json CalibrationJsonOf(const std::vector<Figures>& runs) {
  nlohmann::ordered_json json;
  for (const Bar& bar : Bars()) {
    if (!Measured(bar, runs)) continue;
    const Spread spread = SpreadOf(bar, runs);
    json[bar.name] = {{"median", spread.median}, {"worst", spread.worst}};
  }
  return json;
}

absl::StatusOr<ExitCode> RunCalibration(const CalibrationArguments& arguments) {
  ASSIGN_OR_RETURN(const auto runs, MeasureAll(arguments));
  PrintResult(arguments.format, CalibrationJsonOf(runs), CalibrationTextOf(runs));
  return kDone;
}

}  // namespace

void AddCalibrationCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "calibration",
      "How exact a calibration is, against the simulated cameras' truth: corners, lenses, poses, "
      "lines");
  const auto arguments = std::make_shared<CalibrationArguments>();
  command->add_option("--runs", arguments->runs, "How many, each with other cameras and noise")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "Of the first run; the next one's is one more")
      ->capture_default_str();
  AddFormatOption(*command, arguments->format);
  command->footer(
      "Median and worst of all runs, beside what is asked of the worst.\n\n"
      "Example:\n"
      "  silhouette-experiments calibration --runs 10 --format json");
  RunWhenChosen(*command, run, arguments, RunCalibration);
}

}  // namespace silhouette
