// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate run
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/poses/pose_calibration.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/poses_inputs.h"
#include "tools/silhouette-calibrate/results.h"
#include "tools/silhouette-calibrate/run_session.h"
#include "tools/silhouette-calibrate/run_settings.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct RunCommandArguments {
  RunArguments session;
  bool resume = false;
  std::string robot_sigma;
  bool draw = false;
  std::string format = "text";
};

struct FoundLenses {
  LensSolution solution;
  std::vector<std::string> files;
};

absl::StatusOr<LensSolution> SolveSessionLenses(const Cell& cell, const SessionSettings& settings,
                                                const SessionRecord& record) {
  std::vector<LensCamera> cameras;
  for (const ViewSettings& view : cell.views) {
    cameras.push_back({.name = view.name, .width = view.image_width, .height = view.image_height});
  }
  absl::StatusOr<LensSolution> solution = SolveLenses(cameras, settings.boards, record.sightings);
  if (solution.ok()) return solution;
  return absl::Status(solution.status().code(),
                      absl::StrCat("the lenses: ", solution.status().message()));
}

// The folder of the camera models.
std::string LensFolder(const std::string& session) {
  return (std::filesystem::path(session) / "lenses").string();
}

// The lenses of a session to which none were given, from the boards in its images. It looks at the
// images twice: corners are better once the lenses are known. The better ones take their place in
// `record` and its file; camera models go to the folder `lenses` of the session's. The errors are
// SolveLenses', those of files besides.
absl::StatusOr<FoundLenses> FindLenses(const Cell& cell, const RobotModel& robot,
                                       const SessionSettings& settings, SessionRecord& record) {
  ASSIGN_OR_RETURN(LensSolution solution, SolveSessionLenses(cell, settings, record));
  std::vector<std::string> views;
  std::vector<CameraIntrinsics> lenses;
  for (const SolvedCamera& camera : solution.cameras) {
    views.push_back(camera.name);
    lenses.push_back(camera.model->intrinsics());
  }
  ASSIGN_OR_RETURN(record.sightings,
                   DetectAgain(settings.folder, record.frames, views, lenses, settings.boards));
  RETURN_IF_ERROR(WriteRecord(settings.folder, robot, record));
  ASSIGN_OR_RETURN(solution, SolveSessionLenses(cell, settings, record));
  // That no board ties cameras together is no matter: the robot does.
  if (solution.groups.size() > 1) solution.warnings.pop_back();
  FoundLenses found{.solution = std::move(solution), .files = {}};
  for (const SolvedCamera& camera : found.solution.cameras) {
    ASSIGN_OR_RETURN(const auto written,
                     WriteCameraFile(LensFolder(settings.folder), camera.name, *camera.model));
    found.files.push_back(written);
  }
  return found;
}

std::string InFolder(const RunCommandArguments& arguments, const std::string& name) {
  return (fs::path(arguments.session.out) / name).string();
}

// The command that solves with the data in the folder.
std::string PosesCommand(const RunCommandArguments& arguments) {
  return absl::StrCat("silhouette-calibrate poses --corners ", InFolder(arguments, "corners.csv"),
                      " --robot-poses ", InFolder(arguments, "robot_poses.csv"), " --boards ",
                      arguments.session.boards, " --cameras ", arguments.session.cameras,
                      " --flange-board ", arguments.session.flange_board, " --out ",
                      InFolder(arguments, "cameras"));
}

// report.html in the session's folder; returns its path.
absl::StatusOr<std::string> WriteSessionReport(const RunCommandArguments& arguments,
                                               const PoseProblem& problem,
                                               const PoseSources& sources) {
  ASSIGN_OR_RETURN(const QualityReport report, ReportOn(problem, sources));
  const std::string page = InFolder(arguments, "report.html");
  RETURN_IF_ERROR(WriteReport(report, sources, page, "").status());
  return page;
}

// `found`: the lenses, where they were not given.
absl::StatusOr<ExitCode> RunSolve(const RunCommandArguments& arguments, const Cell& cell,
                                  const std::optional<FoundLenses>& found) {
  const std::string lenses = found ? LensFolder(arguments.session.out) : arguments.session.cameras;
  PoseSources sources;
  sources.corners = InFolder(arguments, "corners.csv");
  sources.boards = arguments.session.boards;
  sources.cameras = lenses;
  sources.robot_poses = InFolder(arguments, "robot_poses.csv");
  sources.flange_board = arguments.session.flange_board;
  sources.robot_sigma = arguments.robot_sigma;
  sources.cell = arguments.session.cell;  // for the report's workspace
  ASSIGN_OR_RETURN(const PoseProblem problem, ReadPoseProblem(sources));
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(problem);
  if (absl::IsFailedPrecondition(solution.status())) {
    std::cerr << "silhouette-calibrate: " << solution.status().message() << std::endl;
    ASSIGN_OR_RETURN(const auto page, WriteSessionReport(arguments, problem, sources));
    std::cerr << "what was seen is shown in " << page << std::endl;
    return kNo;
  }
  if (!solution.ok()) return solution.status();
  PoseProvenance provenance{.command = "run", .lenses = lenses, .masks = MaskSizesOf(cell)};
  if (found) provenance.record = RecordOf(found->solution);
  ASSIGN_OR_RETURN(auto files, WritePoses(InFolder(arguments, "cameras"), problem, *solution,
                                          provenance, arguments.draw));
  ASSIGN_OR_RETURN(const auto page, WriteSessionReport(arguments, problem, sources));
  files.push_back(page);
  nlohmann::ordered_json json = PosesJson(*solution);
  if (found) json["lenses"] = LensJson(found->solution, found->files);
  json["files"] = files;
  PrintResult(arguments.format, json, PosesText(*solution) + TextOfFiles(files));
  return kDone;
}

// After a session that did not come to its end.
absl::StatusOr<ExitCode> TellHowToGoOn(const RunCommandArguments& arguments,
                                       const absl::Status& why, size_t frames) {
  const bool stopped = absl::IsCancelled(why);
  if (!stopped && frames == 0) return why;
  const ExitCode code = stopped ? kNo : Report("silhouette-calibrate", why);
  std::cerr << "silhouette-calibrate: "
            << (stopped ? absl::StrCat("stopped, and so is the robot; ", frames, " frames are kept")
                        : absl::StrCat(frames, " frames are kept"))
            << ". Go on with the same command and --resume";
  if (!arguments.session.cameras.empty() && frames > 0) {
    std::cerr << ", or\nsolve with what there is: " << PosesCommand(arguments);
  }
  std::cerr << std::endl;
  return code;
}

absl::StatusOr<ExitCode> RunWork(RunCommandArguments arguments) {
  CatchStopSignals();
  ASSIGN_OR_RETURN(const Cell cell, LoadCell(arguments.session.cell));
  if (cell.robot.urdf.empty()) {
    return absl::InvalidArgumentError(cell.file + ": the robot needs a 'urdf' for this");
  }
  ASSIGN_OR_RETURN(const auto robot,
                   RobotModel::FromUrdf(cell.robot.urdf, cell.robot.package_paths));
  ASSIGN_OR_RETURN(auto settings, SettingsOf(arguments.session, cell, robot));
  arguments.session.flange_board = settings.flange_board;
  RETURN_IF_ERROR(MakeFolder(settings.folder));
  ASSIGN_OR_RETURN(auto record, ReadRecord(settings.folder, robot));
  if (!arguments.resume && !record.frames.empty()) {
    return absl::AlreadyExistsError(
        absl::StrCat("'", settings.folder, "' has ", record.frames.size(),
                     " frames of a session; go on with it (--resume), or name another folder"));
  }
  ASSIGN_OR_RETURN(const auto devices, OpenDevicesForCalibration(cell));
  const absl::Status recorded =
      RecordSession(cell, robot, settings, *devices.robot, *devices.cameras, record);
  if (!recorded.ok()) return TellHowToGoOn(arguments, recorded, record.frames.size());
  std::optional<FoundLenses> found;
  if (arguments.session.cameras.empty()) {
    auto lenses = FindLenses(cell, robot, settings, record);
    if (absl::IsFailedPrecondition(lenses.status())) {
      std::cerr
          << "silhouette-calibrate: " << lenses.status().message()
          << "\nThe images are kept: take more (--resume and a greater --frames; --joint gives "
             "the robot more room),\nor find the lenses with boards held by hand "
             "(intrinsics) and give them: --resume --cameras FOLDER"
          << std::endl;
      return kNo;
    }
    if (!lenses.ok()) return lenses.status();
    found = *std::move(lenses);
    if (arguments.format != "json") std::cout << LensText(found->solution, found->files);
  }
  return RunSolve(arguments, cell, found);
}

void AddOptions(CLI::App& command, RunCommandArguments& a) {
  command.add_option("--cell", a.session.cell, "The cell file, cell.yaml")->required();
  command.add_option("--boards", a.session.boards, "The boards (YAML)")->required();
  command.add_option("--out", a.session.out, "Folder for images, data and results")->required();
  command.add_option("--flange-board", a.session.flange_board,
                     "The board on the flange; default: 'flange', or the only one");
  command.add_option("--flange-link", a.session.flange_link,
                     "The link that carries it; default: 'flange', else the last");
  command.add_option("--cameras", a.session.cameras,
                     "Folder of camera models, VIEW.cameramodel, for their lenses; without it "
                     "they are found from the boards");
  command.add_option("--frames", a.session.frames, "How many sets of images that show the board")
      ->check(CLI::Range(3, 10000))
      ->capture_default_str();
  command
      .add_option("--joint", a.session.joints,
                  "name=lower:upper: a joint that may be moved, and how far; default: those of the "
                  "grid in its range,\nthe last three up to 60 deg from where they stand")
      ->allow_extra_args(false);
  command.add_option("--floor", a.session.floor,
                     "Height in the robot's base that nothing goes below, metres; default: the "
                     "workspace's, else 0");
  command.add_option(
      "--poses", a.session.poses,
      "Drive to these poses instead (CSV: a column per joint of the robot; radians)");
  command.add_option("--seed", a.session.seed, "Of the choice of poses")->capture_default_str();
  command.add_option("--robot-sigma", a.robot_sigma,
                     "Standard deviation of the robot's poses, per axis; default: 0.2mm,0.02deg");
  command.add_flag("--resume", a.resume, "Go on with the session in the folder");
  command.add_flag("--draw", a.draw, "Pictures of the residuals too");
  AddFormatOption(command, a.format);
}

}  // namespace

void AddRunCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "run", "A whole session on a cell: drives the robot, takes images, solves");
  auto arguments = std::make_shared<RunCommandArguments>();
  AddOptions(*command, *arguments);
  command->footer(
      "The robot moves. It observes joint limits, forbidden regions and the floor. It does not "
      "know "
      "other objects in the cell,\nnor does it check collisions with itself: watch it, and limit "
      "it "
      "with --joint.\n"
      "Exit code 1: the images give no reliable calibration; the message states the reason.\n\n"
      "Example:\n"
      "  silhouette-calibrate run --cell cell.yaml --boards boards.yaml --out session\n"
      "  silhouette-db calibration import cell.lmdb session/cameras");
  command->callback([arguments, &run] { run = [arguments] { return RunWork(*arguments); }; });
}

}  // namespace silhouette
