// SPDX-License-Identifier: Apache-2.0
// silhouette-capture report: the quality report of a capture, as a page with pictures.
#include <iostream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/session_log.h"
#include "tools/silhouette-capture/session_page.h"
#include "tools/silhouette-capture/session_report.h"

namespace silhouette {
namespace {

struct ReportOptions {
  CellArguments cell;
  std::string out;
  std::string log;
};

absl::StatusOr<ExitCode> ReportRun(const ReportOptions& options) {
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(options.cell));
  if (file.cell.robot.drawn) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", file.cell.file,
                     "' says that the robot's images are drawn: no capture is there to report on; "
                     "verify the model with: ",
                     options.cell.Command("verify-model")));
  }
  ASSIGN_OR_RETURN(const auto database, OpenDatabase(file, Database::Access::kRead));
  const std::string folder =
      options.out.empty() ? DefaultReportFolder(file.database, file.variant) : options.out;
  ASSIGN_OR_RETURN(
      const auto facts,
      WriteSessionReport(options.cell, file.cell.name, *database,
                         options.log.empty() ? BesideDatabase(file.database, ".log") : options.log,
                         folder));
  if (options.cell.json()) {
    std::cout << SessionJson(facts, database->cell()).dump(2) << std::endl;
  } else {
    std::cout << VerdictOf(facts) << "\nreport: " << folder << "/report.html\n";
    for (const std::string& command : facts.repair) std::cout << "repair: " << command << "\n";
    std::cout << std::flush;
  }
  return facts.good() ? kDone : kNo;
}

}  // namespace

void AddReport(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "report",
      "Quality report of a capture: coverage, quality of each view, repeatability of the control\n"
      "configurations, outliers, suspect masks, the log, and the commands to repair it. Writes\n"
      "report.html with pictures, and report.json for programs. Reads only; works during a "
      "capture.\n"
      "Exit code 0: nothing to repair; 1: something to repair.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture report --cell cell.yaml --database cell.lmdb --out report\n"
      "  silhouette-capture report --cell cell.yaml --variant gripper-open");
  const auto options = std::make_shared<ReportOptions>();
  AddCellOptions(*command, options->cell);
  AddVariantOption(*command, options->cell);
  command->add_option(
      "--out", options->out,
      "The folder for the report; default: the database's name, that of another variant,\n"
      "and .report");
  command->add_option("--log", options->log,
                      "The sessions' log; default: the database's name and .log");
  command->callback([options, &work] { work = [options] { return ReportRun(*options); }; });
}

}  // namespace silhouette
