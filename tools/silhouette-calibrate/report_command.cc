// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate report
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "calib/report/report_page.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/poses_inputs.h"
#include "tools/silhouette-calibrate/results.h"

namespace silhouette {
namespace {

struct ReportArguments {
  PoseSources sources;
  bool degrees = false;
  std::string workspace;
  int groups = 8;
  std::string out = "report.html";
  std::string json;
  std::string format = "text";
};

absl::StatusOr<ExitCode> ReportWork(const ReportArguments& arguments) {
  const PoseSources sources = WithUnit(arguments.sources, arguments.degrees);
  ASSIGN_OR_RETURN(const PoseProblem problem, ReadPoseProblem(sources));
  ASSIGN_OR_RETURN(QualityReport report,
                   ReportOn(problem, sources, arguments.workspace, arguments.groups));
  const bool refused = !report.refusal.empty();
  if (refused) {
    const std::string hint = HintOfUnit(sources);
    if (!hint.empty()) absl::StrAppend(&report.refusal, "; ", hint);
    std::cerr << "silhouette-calibrate: " << report.refusal << std::endl;
  }
  ASSIGN_OR_RETURN(const auto files, WriteReport(report, sources, arguments.out, arguments.json));
  nlohmann::ordered_json json = ReportJson(report);
  json["files"] = files;
  PrintResult(arguments.format, json, ReportText(report) + TextOfFiles(files));
  return refused ? kNo : kDone;
}

}  // namespace

void AddReportCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "report",
      "Report how good a calibration is, by images that it was not made from: one HTML page");
  auto arguments = std::make_shared<ReportArguments>();
  ReportArguments& a = *arguments;
  AddPoseSources(*command, a.sources, a.degrees);
  // The robot's model also gives its workspace.
  command->get_option("--urdf")->remove_needs(command->get_option("--joints"));
  command->add_option(
      "--workspace", a.workspace,
      "Where the robot works, x0:x1,y0:y1,z0:z1 in its base, metres; default: where "
      "its links get\n(--cell, --urdf), else where boards were seen");
  command->add_option("--groups", a.groups, "Groups of frames that are left out one at a time")
      ->check(CLI::Range(2, 100))
      ->capture_default_str();
  command->add_option("--out", a.out, "The page; it needs no other file")->capture_default_str();
  command->add_option("--json", a.json, "All figures as JSON, too");
  AddFormatOption(*command, a.format);
  command->footer(
      "Reads the same files as `poses` and solves them again without parts of them: some seconds.\n"
      "Exit code 1: the data give no calibration; the page states the reason and shows what was "
      "seen.\n\n"
      "Example:\n"
      "  silhouette-calibrate report --corners corners.csv --boards boards.yaml --cameras lenses "
      "\\\n"
      "      --robot-poses poses.csv --flange-board flange --cell cell.yaml --out report.html");
  command->callback([arguments, &run] { run = [arguments] { return ReportWork(*arguments); }; });
}

}  // namespace silhouette
