// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments calibration
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/calibration/error_lines.h"
#include "tools/silhouette-experiments/calibration/model_errors.h"
#include "tools/silhouette-experiments/calibration/rendered_boards.h"
#include "tools/silhouette-experiments/calibration/trials.h"
#include "tools/silhouette-experiments/commands.h"

namespace silhouette {
namespace {

using calibration_experiment::Bar;
using calibration_experiment::Bars;
using calibration_experiment::BoardLine;
using calibration_experiment::BoardLines;
using calibration_experiment::BoardResult;
using calibration_experiment::CornerCount;
using calibration_experiment::ErrorLine;
using calibration_experiment::ErrorLines;
using calibration_experiment::Figures;
using calibration_experiment::LineResult;
using calibration_experiment::Spread;

// A single calibration's errors have a few common causes: their chi2 says little.
constexpr int kCalibrations = 16;

struct CalibrationArguments {
  int runs = 5;
  uint64_t seed = 1;
  bool model_errors = false;
  bool rendered = false;
  int images = 40;
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
  std::vector<Figures> runs;
  Progress progress("calibrating", static_cast<uint64_t>(arguments.runs), "runs");
  for (int run = 0; run < arguments.runs; ++run) {
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
    json[bar.name] = {{"median", spread.median},
                      {"worst", spread.worst},
                      {"at_least", bar.at_least},
                      {"at_most", bar.at_most},
                      {"meets_goals", Passes(bar, spread)}};
  }
  return json;
}

struct ErrorTable {
  struct Row {
    const ErrorLine* line = nullptr;
    LineResult lenses = {};
    LineResult poses = {};
  };
  std::vector<Row> rows;
  bool mrcal = true;  // whether there is the program mrcal-calibrate-cameras
};

absl::StatusOr<ErrorTable> MeasureErrorTable(const CalibrationArguments& arguments) {
  ErrorTable table;
  for (const ErrorLine& line : ErrorLines()) table.rows.push_back({.line = &line});
  uint64_t done = 0;
  const auto runs = static_cast<uint64_t>(arguments.runs);
  Progress progress("calibrating", runs * table.rows.size(), "sessions");
  for (uint64_t seed = arguments.seed; seed < arguments.seed + runs; ++seed) {
    for (ErrorTable::Row& row : table.rows) {
      absl::Status lenses = MeasureLensLine(*row.line, seed, table.mrcal, row.lenses);
      if (absl::IsNotFound(lenses)) {
        table.mrcal = false;
        row.lenses = {};
        lenses = MeasureLensLine(*row.line, seed, false, row.lenses);
      }
      RETURN_IF_ERROR(lenses);
      RETURN_IF_ERROR(MeasurePoseLine(*row.line, seed, row.poses));
      progress.Update(++done);
    }
  }
  return table;
}

void AddErrorRow(std::string_view what, const char* name, double unit, const LineResult& result,
                 std::string& text) {
  absl::StrAppendFormat(&text, "%-8s %-8s %7d ", name, std::string(what), result.refused);
  if (result.error.count() == 0) {
    absl::StrAppend(&text, "  refused: ", result.refusal, "  MISSED\n");
    return;
  }
  absl::StrAppendFormat(&text, "%9.4f ", unit * result.error.Result());
  if (result.others.count() > 0) {
    absl::StrAppendFormat(&text, "%9.4f %+7.1f %% ", unit * result.others.Result(),
                          100 * WorseThanOthers(result));
  } else {
    absl::StrAppendFormat(&text, "%9s %9s ", "", "");
  }
  absl::StrAppendFormat(&text, "%6.2f%s", result.predicted.PerFreedom(),
                        MeetsGoals(result) ? "" : "  MISSED");
  if (result.others_failed > 0) {
    absl::StrAppendFormat(&text, "  (others failed in %d runs: %s)", result.others_failed,
                          result.others_failure);
  }
  absl::StrAppend(&text, "\n");
}

std::string ErrorTextOf(const ErrorTable& table) {
  std::string text = absl::StrFormat("%-8s %-8s %7s %9s %9s %9s %6s\n", "line", "what", "refused",
                                     "own", "others", "worse by", "chi2");
  for (const ErrorTable::Row& row : table.rows) {
    AddErrorRow("lens px", row.line->name, 1, row.lenses, text);
    AddErrorRow("pose mm", row.line->name, 1000, row.poses, text);
  }
  absl::StrAppend(&text, "\n");
  for (const ErrorLine& line : ErrorLines()) {
    absl::StrAppendFormat(&text, "%-8s %s\n", line.name, line.meaning);
  }
  if (!table.mrcal) {
    absl::StrAppend(&text, "Lenses have no others: there is no program mrcal-calibrate-cameras.\n");
  }
  return text;
}

nlohmann::ordered_json JsonOf(const LineResult& result) {
  nlohmann::ordered_json json = {
      {"runs", result.runs}, {"refused", result.refused}, {"meets_goals", MeetsGoals(result)}};
  if (result.refused > 0) json["refusal"] = result.refusal;
  if (result.error.count() == 0) return json;
  json["error"] = result.error.Result();
  if (result.others.count() > 0) {
    json["others"] = result.others.Result();
    json["worse_by"] = WorseThanOthers(result);
  }
  if (result.others_failed > 0) json["others_failed"] = result.others_failed;
  json["chi2_per_dof"] = result.predicted.PerFreedom();
  return json;
}

nlohmann::ordered_json ErrorJsonOf(const ErrorTable& table) {
  nlohmann::ordered_json json;
  for (const ErrorTable::Row& row : table.rows) {
    json[row.line->name] = {{"meaning", row.line->meaning},
                            {"lenses_px", JsonOf(row.lenses)},
                            {"poses_m", JsonOf(row.poses)}};
  }
  return json;
}

// By BoardLines().
absl::StatusOr<std::vector<BoardResult>> MeasureBoards(const CalibrationArguments& arguments) {
  std::vector<BoardResult> results(BoardLines().size());
  const auto runs = static_cast<uint64_t>(arguments.runs);
  uint64_t done = 0;
  Progress progress("calibrating", runs * results.size(), "sessions");
  for (uint64_t seed = arguments.seed; seed < arguments.seed + runs; ++seed) {
    for (size_t i = 0; i < results.size(); ++i) {
      RETURN_IF_ERROR(MeasureBoardLine(BoardLines()[i], arguments.images, seed, results[i]));
      progress.Update(++done);
    }
  }
  return results;
}

std::string CornersText(const CornerCount& corners) {
  if (corners.visible() == 0) return absl::StrFormat("%28s", "");
  return absl::StrFormat("%6.1f %% %5d %6.4f %6.4f", 100 * corners.ShareFound(),
                         corners.false_corners(), corners.Rms(), corners.Percentile(95));
}

std::string LensText(const LineResult& lens) {
  if (lens.error.count() == 0) return absl::StrCat("  refused: ", lens.refusal);
  const std::string others =
      lens.others.count() > 0 ? absl::StrFormat("%8.4f", lens.others.Result()) : "";
  return absl::StrFormat("%8.4f %8s %5.2f", lens.error.Result(), others,
                         lens.predicted.PerFreedom()) +
         (lens.refused > 0 ? absl::StrFormat("  (refused in %d runs)", lens.refused) : "");
}

std::string BoardsTextOf(const std::vector<BoardResult>& results) {
  std::string text = absl::StrFormat(
      "%-10s %-36s %6s  %-28s  %s\n%-10s %8s %5s %6s %6s %6s %6s  %8s %5s %6s %6s  %8s %8s %5s\n",
      "", "corners", "", "OpenCV's corners", "lens, px", "board", "found", "false", "rms", "median",
      "95 %", "stated", "found", "false", "rms", "95 %", "own", "OpenCV", "chi2");
  for (size_t i = 0; i < results.size(); ++i) {
    const BoardResult& result = results[i];
    absl::StrAppendFormat(&text, "%-10s %6.1f %% %5d %6.4f %6.4f %6.4f %6.2f  %s  %s\n",
                          BoardLines()[i].name, 100 * result.corners.ShareFound(),
                          result.corners.false_corners(), result.corners.Rms(),
                          result.corners.Percentile(50), result.corners.Percentile(95),
                          std::sqrt(result.stated.PerFreedom()), CornersText(result.of_opencv),
                          LensText(result.lens));
  }
  absl::StrAppend(&text, "\n");
  for (const BoardLine& line : BoardLines()) {
    absl::StrAppendFormat(&text, "%-10s %s\n", line.name, line.meaning);
  }
  return text;
}

nlohmann::ordered_json JsonOf(const CornerCount& corners) {
  return {{"visible", corners.visible()},        {"found", corners.found()},
          {"false", corners.false_corners()},    {"rms_px", corners.Rms()},
          {"median_px", corners.Percentile(50)}, {"percentile_95_px", corners.Percentile(95)}};
}

nlohmann::ordered_json BoardsJsonOf(const std::vector<BoardResult>& results) {
  nlohmann::ordered_json json;
  for (size_t i = 0; i < results.size(); ++i) {
    const BoardResult& result = results[i];
    nlohmann::ordered_json& line = json[BoardLines()[i].name];
    line = {{"meaning", BoardLines()[i].meaning}, {"corners", JsonOf(result.corners)}};
    line["corners"]["rms_per_stated"] = std::sqrt(result.stated.PerFreedom());
    if (result.of_opencv.visible() > 0) line["opencv_corners"] = JsonOf(result.of_opencv);
    line["lens_px"] = JsonOf(result.lens);
  }
  return json;
}

absl::StatusOr<ExitCode> RunCalibration(const CalibrationArguments& arguments) {
  if (arguments.model_errors) {
    ASSIGN_OR_RETURN(const auto table, MeasureErrorTable(arguments));
    PrintResult(arguments.format, ErrorJsonOf(table), ErrorTextOf(table));
    return kDone;
  }
  if (arguments.rendered) {
    ASSIGN_OR_RETURN(const auto results, MeasureBoards(arguments));
    PrintResult(arguments.format, BoardsJsonOf(results), BoardsTextOf(results));
    return kDone;
  }
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
  CLI::Option* model_errors =
      command->add_flag("--model-errors", arguments->model_errors,
                        "Instead: sessions that are not as the models say (print, lens, time, "
                        "blur, robot), beside mrcal-calibrate-cameras and cv::calibrateHandEye");
  CLI::Option* rendered =
      command
          ->add_flag("--rendered", arguments->rendered,
                     "Instead: rendered images of a board of each kind that is shown to a camera; "
                     "corners and lens beside OpenCV's")
          ->excludes(model_errors);
  command->add_option("--images", arguments->images, "Of a session of --rendered")
      ->check(CLI::Range(6, 10000))
      ->needs(rendered)
      ->capture_default_str();
  AddFormatOption(*command, arguments->format);
  command->footer(
      "Median and worst of all runs, beside what is asked of the worst. A refused run of\n"
      "--model-errors misses the goals, except for a quarter of the runs of 'few'.\n\n"
      "Example:\n"
      "  silhouette-experiments calibration --runs 10 --format json\n"
      "  silhouette-experiments calibration --model-errors --runs 6\n"
      "  silhouette-experiments calibration --rendered --runs 3");
  RunWhenChosen(*command, run, arguments, RunCalibration);
}

}  // namespace silhouette
