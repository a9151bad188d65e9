// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate run
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "calib/boards/csv.h"
#include "calib/intrinsics/lens_doubts.h"
#include "calib/intrinsics/solve_lenses.h"
#include "calib/poses/pose_calibration.h"
#include "calib/report/quality_report.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/cell/devices/stop_command.h"
#include "tools/program/for_shell.h"
#include "tools/program/joint_values.h"
#include "tools/program/lengths.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/poses_inputs.h"
#include "tools/silhouette-calibrate/results.h"
#include "tools/silhouette-calibrate/run_session.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// The arguments of the session, and of what follows it.
struct RunArguments {
  std::string cell;
  std::string boards;
  std::string out;
  std::string flange_board;
  std::string flange_link;
  std::string cameras;
  size_t frames = 60;
  std::vector<std::string> joints;  // name=lower:upper
  std::optional<double> floor;
  std::string poses;
  uint64_t seed = 1;
  bool resume = false;
  std::string robot_sigma;
  bool draw = false;
  std::string format = "text";
};

constexpr int kLeastFrames = 3;
constexpr size_t kWristJoints = 3;
constexpr double kWristRange = std::numbers::pi / 3;  // of joints that turn

absl::StatusOr<std::string> FlangeBoardOf(const std::vector<Board>& boards,
                                          const std::string& name) {
  std::vector<std::string> names;
  const Board* found = name.empty() && boards.size() == 1 ? &boards[0] : nullptr;
  for (const Board& board : boards) {
    names.push_back(board.description().name);
    if (names.back() == (name.empty() ? "flange" : name)) found = &board;
  }
  if (found != nullptr) {
    RETURN_IF_ERROR(CheckFrameIsCertain(*found));
    return found->description().name;
  }
  return InvalidArgument("which board is on the flange? --flange-board is one of ",
                         ListOfWords(names));
}

std::vector<MovingJoint> UsualJoints(const Cell& cell, const RobotModel& robot, size_t flange) {
  std::vector<MovingJoint> moving;
  for (const GridJoint& joint : cell.grid.joints()) {
    moving.push_back({robot.JointIndex(joint.name).value(), joint.lower, joint.upper});
  }
  const std::vector<size_t> chain = JointsTo(robot, flange);
  for (size_t i = chain.size() - std::min(kWristJoints, chain.size()); i < chain.size(); ++i) {
    const RobotJoint& joint = robot.joints()[chain[i]];
    const auto fixed = std::ranges::find(cell.fixed_joints, joint.name, &FixedJoint::name);
    if (fixed == cell.fixed_joints.end() || joint.type == JointType::kPrismatic) continue;
    moving.push_back({chain[i], std::max(joint.lower, fixed->position - kWristRange),
                      std::min(joint.upper, fixed->position + kWristRange)});
  }
  return moving;
}

absl::StatusOr<MovingJoint> ParseRange(const std::string& text, const RobotModel& robot) {
  const std::vector<std::string> sides = absl::StrSplit(text, absl::MaxSplits('=', 1));
  const std::vector<std::string> bounds =
      sides.size() == 2 ? std::vector<std::string>(absl::StrSplit(sides[1], ':'))
                        : std::vector<std::string>();
  if (bounds.size() != 2) {
    return InvalidArgument("--joint ", text,
                           ": name=lower:upper is expected, e.g. wrist=-30deg:30deg");
  }
  const auto index = robot.JointIndex(sides[0]);
  if (!index) {
    return InvalidArgument("--joint ", text, ": ", robot.NoJoint(sides[0]).message());
  }
  const RobotJoint& joint = robot.joints()[*index];
  const bool slides = joint.type == JointType::kPrismatic;
  const double lower = ParseJointValue(bounds[0], AngleUnit::kRadians, slides);
  const double upper = ParseJointValue(bounds[1], AngleUnit::kRadians, slides);
  if (!(lower <= upper && lower >= joint.lower && upper <= joint.upper)) {
    return InvalidArgument("--joint ", text,
                           ": the bounds are not in order, or beyond the joint's ", joint.lower,
                           " to ", joint.upper);
  }
  return MovingJoint{*index, lower, upper};
}

absl::StatusOr<std::vector<PosePlan::Positions>> ReadPoses(const std::string& path,
                                                           const RobotModel& robot) {
  ASSIGN_OR_RETURN(const auto text, ReadWholeFile(path));
  std::vector<std::string> names;
  for (const RobotJoint& joint : robot.joints()) names.push_back(joint.name);
  ASSIGN_OR_RETURN(const auto rows, CsvRows(text, path, names));
  std::vector<PosePlan::Positions> poses;
  for (const CsvRow& row : rows) {
    PosePlan::Positions values;
    for (size_t j = 0; j < names.size(); ++j) {
      ASSIGN_OR_RETURN(const auto value, row.Number(j));
      values.push_back(value);
    }
    const auto positions = robot.Positions(names, values);
    if (!positions.ok()) {
      return InvalidArgument(row.place(), ": ", positions.status().message());
    }
    poses.push_back(*positions);
  }
  if (poses.empty()) return InvalidArgument(path + ": there is no pose in it");
  return poses;
}

absl::StatusOr<std::map<std::string, CameraModel>> ReadLenses(const std::string& folder,
                                                              const Cell& cell) {
  ASSIGN_OR_RETURN(const auto cameras, ReadCameraFolder(folder));
  std::map<std::string, CameraModel> lenses;
  for (const ViewSettings& view : cell.views) {
    const auto found = std::ranges::find(cameras, view.name, &CameraFile::view);
    if (found == cameras.end()) {
      return NotFound("there is no camera model of the view '", view.name, "' in ", folder);
    }
    const CameraIntrinsics& lens = found->camera.intrinsics();
    if (lens.width != view.image_width || lens.height != view.image_height) {
      return InvalidArgument(folder, ": the camera of '", view.name, "' is for images of ",
                             lens.width, " x ", lens.height, ", the cell's are ", view.image_width,
                             " x ", view.image_height);
    }
    lenses.emplace(view.name, lens);
  }
  return lenses;
}

// InvalidArgument or NotFound in a sentence: files that are not there or wrong, boards, links or
// joints that there are not, a range that is none.
absl::StatusOr<SessionSettings> SettingsOf(const RunArguments& arguments, const Cell& cell,
                                           const RobotModel& robot) {
  SessionSettings settings;
  settings.folder = arguments.out;
  settings.frames = arguments.frames;
  settings.seed = arguments.seed;
  settings.floor = arguments.floor.value_or(cell.workspace ? cell.workspace->min().z() : 0);
  ASSIGN_OR_RETURN(settings.tags.boards, ReadBoards(arguments.boards));
  ASSIGN_OR_RETURN(settings.flange_board,
                   FlangeBoardOf(settings.tags.boards, arguments.flange_board));
  ASSIGN_OR_RETURN(settings.flange, FlangeLink(robot, arguments.flange_link));
  settings.joints = UsualJoints(cell, robot, settings.flange);
  if (!arguments.joints.empty()) settings.joints.clear();
  for (const std::string& range : arguments.joints) {
    ASSIGN_OR_RETURN(const auto joint, ParseRange(range, robot));
    settings.joints.push_back(joint);
  }
  if (!arguments.poses.empty()) {
    ASSIGN_OR_RETURN(settings.given, ReadPoses(arguments.poses, robot));
  }
  if (!arguments.cameras.empty()) {
    ASSIGN_OR_RETURN(settings.tags.lenses, ReadLenses(arguments.cameras, cell));
  }
  return settings;
}

struct FoundLenses {
  LensSolution solution;
  std::vector<std::string> files;
};

// `last`: refuses also what `intrinsics` refuses of a solution.
absl::StatusOr<LensSolution> SolveSessionLenses(const Cell& cell, const SessionSettings& settings,
                                                const SessionRecord& record, bool last) {
  std::vector<LensCamera> cameras;
  for (const ViewSettings& view : cell.views) {
    cameras.push_back({.name = view.name, .width = view.image_width, .height = view.image_height});
  }
  Steps steps("lenses");
  const LensSettings lens_settings{.step = [&](const std::string& step) { steps.Begin(step); }};
  // Others stand still: their images, all alike, would only add their kind of board.
  std::vector<Board> boards = settings.tags.boards;
  std::erase_if(boards, [&](const Board& board) {
    return board.description().name != settings.flange_board;
  });
  absl::StatusOr<LensSolution> solution =
      SolveLenses(cameras, boards, record.sightings, lens_settings);
  absl::Status status = solution.status();
  if (!status.ok()) {
    const std::string wrong = WrongGaps(boards, record.sightings);
    status = absl::Status(status.code(),
                          absl::StrCat(status.message(), wrong.empty() ? "" : "; ", wrong));
  } else if (last) {
    status = CheckFit(cameras, boards, record.sightings, lens_settings, *solution);
  }
  if (status.ok()) return solution;
  return absl::Status(status.code(), absl::StrCat("the lenses: ", status.message()));
}

// The folder of the camera models.
std::string LensFolder(const std::string& session) {
  return (std::filesystem::path(session) / "lenses").string();
}

// The lenses of a session to which none were given, from the flange's board in its images. It looks
// at the images twice: corners are better once the lenses are known. The better ones take their
// place in `record` and its file; camera models go to the folder `lenses` of the session's. The
// errors are SolveLenses' and CheckFit's, those of files besides.
absl::StatusOr<FoundLenses> FindLenses(const Cell& cell, const RobotModel& robot,
                                       const SessionSettings& settings, SessionRecord& record) {
  ASSIGN_OR_RETURN(LensSolution solution, SolveSessionLenses(cell, settings, record, false));
  std::vector<std::string> views;
  DetectSettings known{.boards = settings.tags.boards};
  for (const SolvedCamera& camera : solution.cameras) {
    views.push_back(camera.name);
    known.lenses.emplace(camera.name, *camera.model);
  }
  ASSIGN_OR_RETURN(record.sightings, DetectAgain(settings.folder, record.frames, views, known));
  RETURN_IF_ERROR(WriteRecord(settings.folder, robot, record));
  ASSIGN_OR_RETURN(solution, SolveSessionLenses(cell, settings, record, true));
  // That no board ties cameras together is no matter: the robot does.
  if (solution.groups.size() > 1) solution.warnings.pop_back();
  FoundLenses found{.solution = std::move(solution), .files = {}};
  for (const SolvedCamera& camera : found.solution.cameras) {
    ASSIGN_OR_RETURN(const auto written, WriteCameraFile(LensFolder(settings.folder), camera.name,
                                                         *camera.model, camera.known));
    found.files.push_back(written);
  }
  return found;
}

std::string InFolder(const RunArguments& arguments, const std::string& name) {
  return (fs::path(arguments.out) / name).string();
}

// The command that solves with the frames in the folder, at least kLeastFrames of them: this one
// again, so that it refuses the same.
std::string SolveCommand(const RunArguments& arguments) {
  std::string command = absl::StrCat("silhouette-calibrate run --resume --frames ", kLeastFrames);
  const std::pair<const char*, const std::string&> options[] = {
      {"--cell", arguments.cell},
      {"--boards", arguments.boards},
      {"--out", arguments.out},
      {"--flange-board", arguments.flange_board},
      {"--flange-link", arguments.flange_link},
      {"--cameras", arguments.cameras},
      {"--robot-sigma", arguments.robot_sigma}};
  for (const auto& [option, value] : options) {
    if (!value.empty()) absl::StrAppend(&command, " ", option, " ", ForShell(value));
  }
  if (arguments.draw) command += " --draw";
  return command;
}

// The report, which is also written as report.html into the session's folder, and that file.
struct SessionReport {
  QualityReport report;
  std::string page;
};

absl::StatusOr<SessionReport> ReportOnSession(const RunArguments& arguments,
                                              const PoseProblem& problem,
                                              const PoseSources& sources) {
  SessionReport session{.report = {}, .page = InFolder(arguments, "report.html")};
  ASSIGN_OR_RETURN(session.report, ReportOn(problem, sources));
  RETURN_IF_ERROR(WriteReport(session.report, sources, session.page, "").status());
  return session;
}

// What the report of an unstable calibration warns of goes into calibration.yaml. The solution's
// own warnings get there anyway.
void AddWarnings(const QualityReport& report, const PoseSolution& solution,
                 storage::v1::CalibrationRecord& record) {
  for (const std::string& warning : report.warnings) {
    if (std::ranges::count(solution.warnings, warning) == 0) record.add_warnings(warning);
  }
}

// After a refusal.
void WarnOfEarlierCameras(const RunArguments& arguments) {
  const std::string cameras = InFolder(arguments, "cameras");
  if (!fs::exists(cameras)) return;
  std::cerr << "silhouette-calibrate: no cameras are written; those in '" << cameras
            << "' are of an earlier solution: do not use them" << std::endl;
}

// `found`: the lenses, where they were not given.
absl::StatusOr<ExitCode> RunSolve(const RunArguments& arguments, const Cell& cell,
                                  const std::optional<FoundLenses>& found) {
  const std::string lenses = found ? LensFolder(arguments.out) : arguments.cameras;
  PoseSources sources;
  sources.corners = InFolder(arguments, "corners.csv");
  sources.boards = arguments.boards;
  sources.cameras = lenses;
  sources.robot_poses = InFolder(arguments, "robot_poses.csv");
  sources.flange_board = arguments.flange_board;
  sources.robot_sigma = arguments.robot_sigma;
  sources.cell = arguments.cell;  // for the report's workspace
  ASSIGN_OR_RETURN(const PoseProblem problem, ReadPoseProblem(sources));
  const absl::StatusOr<PoseSolution> solution = CalibratePosesInSteps(problem);
  if (!solution.ok()) WarnOfEarlierCameras(arguments);
  if (absl::IsFailedPrecondition(solution.status())) {
    std::cerr << "silhouette-calibrate: " << solution.status().message() << std::endl;
    ASSIGN_OR_RETURN(const auto judged, ReportOnSession(arguments, problem, sources));
    std::cerr << "what was seen is shown in " << judged.page << std::endl;
    return kNo;
  }
  if (!solution.ok()) return solution.status();
  ASSIGN_OR_RETURN(const auto judged, ReportOnSession(arguments, problem, sources));
  const bool stable = IsStable(judged.report);
  PoseProvenance provenance{.command = "run", .lenses = lenses, .masks = MaskSizesOf(cell)};
  if (found) provenance.record = RecordOf(found->solution);
  if (!stable) AddWarnings(judged.report, *solution, provenance.record);
  ASSIGN_OR_RETURN(auto files, WritePoses(InFolder(arguments, "cameras"), problem, *solution,
                                          provenance, arguments.draw));
  files.push_back(judged.page);
  nlohmann::ordered_json json = PosesJson(*solution);
  if (found) json["lenses"] = LensJson(found->solution, found->files);
  json["files"] = files;
  PrintResult(arguments.format, json, PosesText(*solution) + TextOfFiles(files));
  if (stable) return kDone;
  std::cerr << "silhouette-calibrate: " << kNotStable << " (" << judged.page << ")" << std::endl;
  return kNo;
}

// After a session that did not come to its end.
absl::StatusOr<ExitCode> TellHowToGoOn(const RunArguments& arguments, const absl::Status& why,
                                       size_t frames) {
  const bool stopped = absl::IsCancelled(why);
  if (!stopped && frames == 0) return why;
  const ExitCode code = stopped ? kNo : Report("silhouette-calibrate", why);
  std::cerr << "silhouette-calibrate: "
            << (stopped ? absl::StrCat("stopped, and so is the robot; ", frames, " frames are kept")
                        : absl::StrCat(frames, " frames are kept"))
            << ". Go on with the same command and --resume";
  if (frames >= size_t{kLeastFrames}) {
    std::cerr << ", or\nsolve with what there is (the robot does not move): "
              << SolveCommand(arguments);
  }
  std::cerr << std::endl;
  return code;
}

// After a session whose lenses were not found.
absl::StatusOr<ExitCode> TellOfLenses(const RunArguments& arguments, const absl::Status& why) {
  WarnOfEarlierCameras(arguments);
  if (absl::IsCancelled(why)) return why;
  const ExitCode code = Report("silhouette-calibrate", why);
  const bool more = absl::IsFailedPrecondition(why);  // images would mend it
  std::cerr << (more ? "The images are kept: take more (--resume and a greater --frames; --joint "
                       "gives the robot more room),\nor find the lenses with boards held by hand "
                       "(intrinsics) and give them: --resume --cameras FOLDER"
                     : "The images are kept: mend it, and go on with --resume")
            << std::endl;
  return more ? kNo : code;
}

absl::StatusOr<ExitCode> RunWork(RunArguments arguments) {
  CatchStopSignals();
  ASSIGN_OR_RETURN(const Cell cell, LoadCell(arguments.cell));
  if (cell.robot.model == nullptr) {
    return InvalidArgument(cell.file + ": the robot needs a 'urdf' for this");
  }
  const RobotModel& robot = *cell.robot.model;
  ASSIGN_OR_RETURN(auto settings, SettingsOf(arguments, cell, robot));
  arguments.flange_board = settings.flange_board;
  if (const auto guess = GuessedFlangeLink(robot, arguments.flange_link); !guess.empty()) {
    std::cerr << "silhouette-calibrate: " << guess << std::endl;
  }
  if (arguments.resume && !fs::exists(settings.folder)) {
    return NotFound("there is no session '", settings.folder,
                    "' to go on with; correct --out, or leave --resume out");
  }
  RETURN_IF_ERROR(MakeFolder(settings.folder));
  ASSIGN_OR_RETURN(auto record, ReadRecord(settings.folder, robot, settings.flange));
  if (!arguments.resume && !record.frames.empty()) {
    return absl::AlreadyExistsError(
        absl::StrCat("'", settings.folder, "' has ", record.frames.size(),
                     " frames of a session; go on with it (--resume), or name another folder"));
  }
  if (!record.frames.empty()) {
    if (!fs::exists(InFolder(arguments, "corners.csv"))) {
      std::vector<std::string> views;
      for (const ViewSettings& view : cell.views) views.push_back(view.name);
      ASSIGN_OR_RETURN(record.sightings,
                       DetectAgain(settings.folder, record.frames, views, settings.tags));
    }
    // The solution reads the files: robot_poses.csv is that of the robot's model as it is now.
    RETURN_IF_ERROR(WriteRecord(settings.folder, robot, record));
  }
  // A session that has its frames needs no robot.
  if (!arguments.poses.empty() || record.frames.size() < arguments.frames) {
    ASSIGN_OR_RETURN(const auto devices, OpenDevicesForCalibration(cell));
    // For SIGHUP and a second Ctrl-C; at the first, RecordSession stops the robot.
    const HaltOnSignals halt(StopCommandTo(*devices.robot));
    const absl::Status recorded =
        RecordSession(cell, robot, settings, *devices.robot, *devices.cameras, record);
    if (!recorded.ok()) return TellHowToGoOn(arguments, recorded, record.frames.size());
  }
  std::optional<FoundLenses> found;
  if (arguments.cameras.empty()) {
    auto lenses = FindLenses(cell, robot, settings, record);
    if (!lenses.ok()) return TellOfLenses(arguments, lenses.status());
    found = *std::move(lenses);
    if (arguments.format != "json") std::cout << LensText(found->solution, found->files);
  }
  return RunSolve(arguments, cell, found);
}

void AddOptions(CLI::App& command, RunArguments& a) {
  command.add_option("--cell", a.cell, "The cell file, cell.yaml")->required();
  command.add_option("--boards", a.boards, "The boards (YAML)")->required();
  command.add_option("--out", a.out, "Folder for images, data and results")->required();
  command.add_option("--flange-board", a.flange_board,
                     "The board on the flange; default: 'flange', or the only one");
  command.add_option(
      "--flange-link", a.flange_link,
      "The link that carries it; default: 'flange', else the one that most joints move");
  command.add_option("--cameras", a.cameras,
                     "Folder of camera models, VIEW.cameramodel, for their lenses; without it "
                     "they are found from the flange's board");
  command
      .add_option("--frames", a.frames,
                  "How many sets of images that show the board; a view should have 20 of them")
      ->check(CLI::Range(kLeastFrames, 10000))
      ->capture_default_str();
  command
      .add_option("--joint", a.joints,
                  "name=lower:upper: a joint that may be moved, and how far; default: those of the "
                  "grid in its range,\nthose of the last three that turn up to 60 deg from where "
                  "they are fixed; others do not move")
      ->allow_extra_args(false);
  TakeLengths(command.add_option(
      "--floor", a.floor,
      "Height in the robot's base, metres, that the board and all links that joints raise or "
      "lower\nstay above; the board as a ball of half its diagonal about its link's origin; "
      "default: "
      "the\nworkspace's, else 0"));
  command.add_option(
      "--poses", a.poses,
      "Drive to these poses instead (CSV: a column per joint of the robot; radians)");
  command.add_option("--seed", a.seed, "Of the choice of poses")->capture_default_str();
  command.add_option("--robot-sigma", a.robot_sigma,
                     "Standard deviation of the robot's poses, per axis; default: 0.2mm,0.02deg");
  command.add_flag(
      "--resume", a.resume,
      "Go on with the session in the folder; with no more --frames than it has, and without\n"
      "--poses, solve only");
  command.add_flag("--draw", a.draw, "Pictures of the residuals too");
  AddFormatOption(command, a.format);
}

}  // namespace

void AddRunCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "run", "A whole session on a cell: drives the robot, takes images, solves");
  auto arguments = std::make_shared<RunArguments>();
  AddOptions(*command, *arguments);
  command->footer(
      "The robot moves. It observes joint limits, forbidden regions and the floor. It does not "
      "know "
      "other objects in the cell,\nnor does it check collisions with itself: watch it, and limit "
      "it "
      "with --joint.\n"
      "Exit code 1: the images give no reliable calibration; the message states the reason.\n"
      "It may be written nevertheless: do not use it.\n\n"
      "Example:\n"
      "  silhouette-calibrate run --cell cell.yaml --boards boards.yaml --out session\n"
      "  silhouette-db calibration import cell.lmdb session/cameras");
  command->callback([arguments, &run] { run = [arguments] { return RunWork(*arguments); }; });
}

}  // namespace silhouette
