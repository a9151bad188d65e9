// SPDX-License-Identifier: Apache-2.0
// silhouette-capture run: captures what is missing, or what --only selects.
#include <iostream>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "capture/session/capture_session.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "db/store/collision_index.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/cell/devices/stop_command.h"
#include "tools/cell/expected_robot.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/run_plan.h"
#include "tools/silhouette-capture/session_log.h"
#include "tools/silhouette-capture/session_page.h"
#include "tools/silhouette-capture/session_report.h"

namespace silhouette {
namespace {

struct RunOptions {
  CellArguments cell;
  PlanArguments plan;
  bool dry_run = false;
  bool no_index = false;
  std::string log;     // empty: beside the database
  std::string report;  // likewise
  bool no_report = false;
};

void TellDoubts(const Cell& cell) {
  for (const std::string& doubt : Doubts(cell)) std::cerr << doubt << std::endl;
}

absl::StatusOr<ExitCode> DryRun(const RunOptions& options, const CellFile& file,
                                const Travel& travel) {
  const auto database = OpenDatabase(file, Database::Access::kRead);
  if (!database.ok() && !absl::IsNotFound(database.status())) return database.status();
  const Database* stored = database.ok() ? database->get() : nullptr;
  ASSIGN_OR_RETURN(const auto plan,
                   MakePlan(options.plan, options.cell, file.cell, travel, stored));
  const DiskRoom room = RoomFor(plan, file, stored);
  TellDoubts(file.cell);
  if (options.cell.json()) {
    std::cout << PlanJson(plan, room).dump(2) << std::endl;
  } else {
    std::cout << PlanText(plan, room) << "nothing was moved or stored" << std::endl;
  }
  return kDone;
}

// What the log says of a session before it begins.
void WriteBegin(const RunOptions& options, const CellFile& file, const CapturePlan& plan,
                const DiskRoom& room, SessionLog& log) {
  const CaptureSettings& settings = file.cell.capture;
  const absl::Time now = absl::Now();
  log.Write(absl::StrFormat(
      "session begins: cell '%s', database %s%s, --only %s", file.cell.name, file.database,
      file.variant == schema::kDefaultVariant ? "" : ", variant '" + file.variant + "'",
      options.plan.only));
  log.Write(absl::StrFormat(
      "%d configurations to capture, %d there already; about %s, done about %s",
      plan.captures.size(), plan.kept, Spoken(plan.duration), ClockTime(now + plan.duration, now)));
  log.Write(absl::StrFormat(
      "settle %s, joint_tolerance %g, %d sentinels every %s, retry %s, keep_free %.0f MB",
      SpokenTime(settings.settle), settings.joint_tolerance, settings.sentinels.count,
      SpokenTime(settings.sentinels.every), SpokenTime(settings.retry),
      static_cast<double>(settings.keep_free) / 1e6));
  if (!room.Suffices(plan)) log.Write(TooLittleRoom(plan, room));
}

void WriteEnd(const CaptureReport& report, SessionLog& log) {
  std::string end = "session ends";
  if (!report.status.ok()) {
    absl::StrAppend(&end, ": ", report.status.message());
  } else if (!report.alarm.empty()) {
    absl::StrAppend(&end, ": the control configurations do not show that the cell is as it was");
  } else if (report.stopped) {
    end += ": somebody stopped it";
  }
  absl::StrAppendFormat(&end, "; captured %d of %d configurations in %s", report.captured,
                        report.planned, Spoken(report.duration));
  if (report.failed > 0) absl::StrAppendFormat(&end, ", %d failed", report.failed);
  if (report.suspect > 0) absl::StrAppendFormat(&end, ", %d are suspect", report.suspect);
  log.Write(end);
}

CaptureReport CaptureWithProgress(CaptureSession& session, const CapturePlan& plan, Robot& robot,
                                  SessionLog& log) {
  CatchStopSignals();
  const HaltOnSignals halt(StopCommandTo(robot));
  RunObserver observer(plan.captures.size(), log);
  return session.Run(plan, "silhouette-capture run", observer.Observer());
}

// The collision index of what is stored. Nothing if it is not wanted, or the capture was ended:
// then going on builds it.
std::optional<absl::StatusOr<IndexBuildReport>> RunBuildIndex(const RunOptions& options,
                                                              const CaptureReport& report,
                                                              Database& database) {
  if (options.no_index || !report.status.ok() || report.stopped || !report.alarm.empty()) {
    return std::nullopt;
  }
  std::optional<Progress> progress;
  const auto tell = [&](uint64_t done, uint64_t tiles) {
    if (!progress && tiles > 0) progress.emplace("collision index", tiles, "tiles");
    if (progress) progress->Update(done);
    return !StopRequested();
  };
  return BuildCollisionIndex(database, {.progress = tell});
}

// Says how to go on if the index is not complete.
ExitCode TellIndex(const absl::StatusOr<IndexBuildReport>& index, const std::string& database) {
  if (index.ok() && !index->stopped) return kDone;
  const ExitCode code = index.ok() ? kNo : Report("silhouette-capture", index.status());
  std::cerr << "the robot images are stored, but their collision index is not complete; go on with:"
            << " silhouette-db index " << database << std::endl;
  return code;
}

void TellSuspects(const RunOptions& options, const CaptureReport& report) {
  if (report.suspect == 0) return;
  std::cerr << report.suspect
            << " robot images are suspect: the cell may have changed, a camera was frozen, or 'run "
               "--only all' did not recapture them; a server calls them unknown; when the cell is "
               "as it should be, "
               "recapture them with: "
            << options.cell.Command("run") << " --only suspect" << std::endl;
}

// How to go on where the session ended.
std::string GoOnCommand(const RunOptions& options, const CaptureReport& report) {
  const std::string run = options.cell.Command("run");
  const std::string& only = options.plan.only;
  // What it did not come to is suspect or missing.
  if (only == "all" && report.captured > 0) return run + " --only suspect";
  const bool new_sentinels = options.plan.new_sentinels && report.new_sentinels_left;
  return absl::StrCat(run, only == "missing" ? "" : " --only " + only,
                      new_sentinels ? " --new-sentinels" : "");
}

ExitCode TellAlarm(const RunOptions& options, const CaptureReport& report) {
  const std::string run = options.cell.Command("run");
  std::cerr << "correct that, and check whether it matches with: " << run << " --only sentinels"
            << std::endl;
  if (!report.none_visited) {
    std::cerr << "or accept the change, recapture reference images and robot images: "
              << options.cell.Command("reference") << " && " << run << " --only all" << std::endl;
  }
  TellSuspects(options, report);
  if (report.captured < report.planned) {
    std::cerr << report.planned - report.captured
              << " configurations are left; go on with: " << GoOnCommand(options, report)
              << std::endl;
  }
  return kNo;
}

// Prints the report, what went wrong and how to go on.
ExitCode Tell(const RunOptions& options, const std::string& database, const CaptureReport& report,
              const SessionLog& log, const std::optional<absl::StatusOr<IndexBuildReport>>& index) {
  const std::string again = GoOnCommand(options, report);
  // The first look refused all of it, or nothing began.
  const bool refused = report.captured == 0 && absl::IsFailedPrecondition(report.status);
  if (options.cell.json()) {
    nlohmann::json json = ReportJson(report);
    if (!report.complete() && !refused) json["next"] = again;
    if (report.suspect > 0) json["repair"] = options.cell.Command("run") + " --only suspect";
    json["log"] = log.file();
    if (index && index->ok()) json["collision_index"] = IndexJson(**index);
    std::cout << json.dump(2) << std::endl;
  } else {
    std::cout << ReportText(report);
    if (!log.file().empty()) std::cout << "log                " << log.file() << "\n";
    if (index && index->ok()) std::cout << IndexText(**index);
    std::cout << std::flush;
  }
  const uint64_t left = report.planned - report.captured;
  if (!report.status.ok()) {
    const ExitCode code = Report("silhouette-capture", report.status);
    if (!refused) {
      std::cerr << "what was captured is stored; go on with: " << again << std::endl;
    }
    return code;
  }
  if (!report.alarm.empty()) return TellAlarm(options, report);
  if (report.stopped) {
    std::cerr << "stopped, " << left << " configurations are left; go on with: " << again
              << std::endl;
    return kNo;
  }
  const ExitCode index_code = index ? TellIndex(*index, database) : kDone;
  if (!report.complete()) {
    std::cerr << left << " configurations could not be captured; try them again with: " << again
              << std::endl;
    return index_code == kDone ? kNo : index_code;
  }
  if (report.suspect > 0) TellSuspects(options, report);
  return report.suspect > 0 && index_code == kDone ? kNo : index_code;
}

// The report of all that is stored by now. That it cannot be written changes nothing else.
void WriteReport(const RunOptions& options, const CellFile& file, const Database& database,
                 const CaptureReport& report, const SessionLog& log) {
  if (options.no_report || (report.captured == 0 && report.sentinel_checks == 0)) return;
  const std::string folder =
      options.report.empty() ? DefaultReportFolder(file.database, file.variant) : options.report;
  const auto facts = WriteSessionReport(options.cell, file.cell.name, database, log.file(), folder);
  if (!facts.ok()) {
    std::cerr << "the report could not be written: " << facts.status().message() << std::endl;
    return;
  }
  std::cerr << VerdictOf(*facts) << "; report: " << folder << "/report.html" << std::endl;
}

absl::StatusOr<bool> HasDrawnImages(const Database& database) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto drawn, snapshot.DrawnImages());
  return drawn.has_value();
}

absl::StatusOr<ExitCode> RunHere(const RunOptions& options) {
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(options.cell));
  if (file.cell.robot.drawn) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", file.cell.file,
                     "' says that the robot's images are drawn: there is nothing to capture; ",
                     "to capture them, state 'images: captured' of the robot, and a grid"));
  }
  const Travel travel(file.cell.grid, file.cell.capture.forbidden_regions);
  if (options.dry_run) return DryRun(options, file, travel);

  ASSIGN_OR_RETURN(const auto devices, OpenDevices(file.cell, travel, file.variant));
  const std::string take_references =
      absl::StrCat("; take them first with: ", options.cell.Command("reference"));
  const auto database = OpenDatabase(file, Database::Access::kWrite);
  if (absl::IsNotFound(database.status())) {
    return absl::NotFoundError(absl::StrCat("there is no database in '", file.database,
                                            "' yet, and no reference images of the empty cell",
                                            take_references));
  }
  if (!database.ok()) return database.status();
  ASSIGN_OR_RETURN(const bool drawn, HasDrawnImages(**database));
  if (drawn) {
    return FailedPrecondition("the robot images in '", file.database,
                              "' were drawn; capture into another database");
  }
  const FirstLookSettings& look = file.cell.capture.first_look;
  std::optional<DrawnRobot> expected;
  if (look.configurations > 0 && look.least_overlap > 0) {
    ASSIGN_OR_RETURN(
        expected, ExpectedRobotOf(file.cell, **database, (*database)->mask_sizes(),
                                  "whether the robot is in the right place in the first images"));
  }
  auto session =
      CaptureSession::Create(**database, travel, *devices.robot, *devices.cameras,
                             file.cell.capture, file.cell.segmentation, std::move(expected));
  if (absl::IsNotFound(session.status())) {
    return absl::NotFoundError(absl::StrCat(session.status().message(), take_references));
  }
  if (!session.ok()) return session.status();
  ASSIGN_OR_RETURN(const auto plan,
                   MakePlan(options.plan, options.cell, file.cell, travel, database->get()));
  ASSIGN_OR_RETURN(
      SessionLog log,
      SessionLog::Open(options.log.empty() ? BesideDatabase(file.database, ".log") : options.log));
  TellDoubts(file.cell);
  const DiskRoom room = RoomFor(plan, file, database->get());
  if (!room.Suffices(plan)) std::cerr << TooLittleRoom(plan, room) << std::endl;
  WriteBegin(options, file, plan, room, log);
  if ((*database)->variant() != schema::kDefaultVariant) {
    std::cerr << "variant '" << (*database)->variant()
              << "': the robot must carry the tool and the part of this variant, and nothing else"
              << std::endl;
  }
  const CaptureReport report = CaptureWithProgress(*session, plan, *devices.robot, log);
  WriteEnd(report, log);
  const auto index = RunBuildIndex(options, report, **database);
  const ExitCode code = Tell(options, file.database, report, log, index);
  WriteReport(options, file, **database, report, log);
  return code;
}

}  // namespace

void AddRun(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "run",
      "Moves the robot through the configurations and stores its masks. Safe to interrupt:\n"
      "run the same command again to resume. Updates the collision index at the end.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture run --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-capture run --cell cell.yaml --only outliers\n"
      "  silhouette-capture run --cell cell.yaml --only sentinels    (is the cell as it was?)\n"
      "  silhouette-capture run --cell cell.yaml --variant gripper-open\n"
      "Exit codes: 0 all is captured; 1 stopped, the cell may not be as it was, or some "
      "configurations\n"
      "could not be captured; 2 wrong arguments or files; 3 a device or the disk failed.");
  const auto options = std::make_shared<RunOptions>();
  AddCellOptions(*command, options->cell);
  AddVariantOption(*command, options->cell);
  command
      ->add_option(
          "--only", options->plan.only,
          "What to capture. missing: what has no mask yet. The others add to that:\n"
          "outliers, what is damaged, empty or unlike its neighbours; suspect, what was captured\n"
          "while the cell may have changed, or left by an 'all' that ended early;\n"
          "17,4711, these configurations; all, everything again.\n"
          "sentinels: capture nothing, only check the control configurations (sentinels)")
      ->check(CLI::Validator([](const std::string& only) { return CheckOnly(only); }, ""))
      ->capture_default_str();
  command->add_flag("--dry-run", options->dry_run,
                    "Report number of configurations, duration and disk space; move nothing");
  command->add_flag("--exclude-captured", options->plan.exclude_captured,
                    "Drop robot images in regions that are forbidden by now");
  command->add_flag(
      "--new-sentinels", options->plan.new_sentinels,
      "Recapture the control configurations (sentinels) first and use them as the new\n"
      "baseline");
  command->add_option("--log", options->log,
                      "The file that the session's story is appended to; default: the database's "
                      "name\nand .log");
  command->add_flag("--no-index", options->no_index,
                    "Leave the collision index out; silhouette-db index builds it");
  command->add_option("--report", options->report,
                      "The folder that the report is written into at the end; default: the "
                      "database's\nname, that of another variant, and .report");
  command->add_flag("--no-report", options->no_report,
                    "Leave the report out; silhouette-capture report writes it");
  command->callback([options, &work] { work = [options] { return RunHere(*options); }; });
}

}  // namespace silhouette
