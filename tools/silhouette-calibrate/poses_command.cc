// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate poses, and report
#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_pairs.h"
#include "calib/poses/unknown_lens.h"
#include "calib/report/report_page.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/poses_inputs.h"
#include "tools/silhouette-calibrate/results.h"

namespace silhouette {
namespace {

struct PosesArguments {
  PoseSources sources;
  std::vector<std::string> pairs;  // VIEW=FILE
  std::string mask_size;
  std::string out;
  bool draw = false;
  std::string format = "text";
};

struct ViewPairs {
  std::string view;
  PairFile file;
};

absl::StatusOr<std::vector<ViewPairs>> ReadPairs(const PosesArguments& arguments,
                                                 const PoseProblem& problem) {
  std::vector<ViewPairs> all;
  for (const std::string& argument : arguments.pairs) {
    const size_t equals = argument.find('=');
    const std::string view = argument.substr(0, equals);
    if (equals == std::string::npos ||
        std::ranges::find(problem.views, view, &PoseView::name) == problem.views.end()) {
      return InvalidArgument("--pairs '", argument,
                             "' is not VIEW=FILE of a view with a camera model in '",
                             arguments.sources.cameras, "'");
    }
    if (std::ranges::find(all, view, &ViewPairs::view) != all.end()) {
      return InvalidArgument("--pairs has the view '", view,
                             "' twice; put all its pairs into one file");
    }
    const std::string file = argument.substr(equals + 1);
    ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
    ASSIGN_OR_RETURN(PairFile pairs, PosePairsFromText(text, file));
    all.push_back({view, std::move(pairs)});
  }
  return all;
}

// Adds a view that was solved by pairs, with how they miss as its frames. Of what is doubtful only
// doubts have it, not the warnings.
void AddPairs(const ViewPairs& view, const PairSolution& solved, const UnknownLens& lens,
              bool on_flange, PoseSolution& solution) {
  SolvedView result{.name = view.view,
                    .on_flange = on_flange,
                    .camera_pose = solved.camera_pose,
                    .covariance = solved.covariance};
  const std::vector<PosePair>& pairs = view.file.pairs;
  double squares = 0;
  int outliers = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const PairResidual& residual = solved.residuals[i];
    const Eigen::Vector3d board =
        solved.camera_pose.inverse() * pairs[i].camera_from_board.translation();
    const double sigma = PointSigma(solved.covariance, board);
    squares += sigma * sigma / static_cast<double>(pairs.size());
    result.workspace_sigma_worst = std::max(result.workspace_sigma_worst, sigma);
    outliers += residual.outlier ? 1 : 0;
    solution.frames.push_back({.name = absl::StrCat(view.view, " pair ", i + 1),
                               .robot_offset = residual.position,
                               .robot_rotation = residual.rotation,
                               .robot_outlier = residual.outlier});
  }
  result.workspace_sigma = std::sqrt(squares);
  solution.views.push_back(result);
  solution.warnings.push_back(absl::StrFormat(
      "view '%s': %d pairs of poses, %d left out, at %d poses of the robot, miss each other by "
      "%.2f "
      "mm and %.3f deg (1 sigma per axis); without corners nothing is known of errors of the lens "
      "that all pairs share",
      view.view, pairs.size(), outliers, solved.robot_poses, 1000 * solved.position_sigma,
      solved.rotation_sigma / kDegree));
  if (!solved.warning.empty()) {
    solution.warnings.push_back(absl::StrCat("view '", view.view, "' ", solved.warning));
  }
  const std::string weakness = WeaknessOf(result);
  if (!weakness.empty()) solution.warnings.push_back(weakness);
  for (const std::string& doubt : solved.doubts) {
    solution.doubts.push_back(absl::StrCat("view '", view.view, "' ", doubt));
  }
  if (!lens.sentence.empty()) {
    (lens.refused ? solution.doubts : solution.warnings).push_back(lens.sentence);
  }
}

// --pairs: without corners.
absl::StatusOr<ExitCode> PairsWork(const PosesArguments& arguments) {
  const PoseSources& sources = arguments.sources;
  PoseProblem problem;
  RETURN_IF_ERROR(ReadViews(sources, problem));
  ASSIGN_OR_RETURN(WorkspacePoints workspace, WorkspacePointsOf(sources, ""));
  problem.workspace = std::move(workspace.points);
  ASSIGN_OR_RETURN(const auto masks, MaskSizesFrom(sources.cell, arguments.mask_size, problem));
  ASSIGN_OR_RETURN(const std::vector<ViewPairs> views, ReadPairs(arguments, problem));
  std::vector<PoseView> seen;
  PoseSolution solution;
  for (const ViewPairs& view : views) {
    const PoseView& known = *std::ranges::find(problem.views, view.view, &PoseView::name);
    const auto solved = SolvePairFile(view.file, known, sources.size_trust);
    if (absl::IsFailedPrecondition(solved.status())) {
      std::cerr << "silhouette-calibrate: view '" << view.view << "' " << solved.status().message()
                << "\nnothing was written" << std::endl;
      return kNo;
    }
    if (!solved.ok()) return solved.status();
    AddPairs(view, *solved, FindUnknownLens(problem, known, solved->camera_pose), known.on_flange,
             solution);
    seen.push_back(known);
  }
  if (!solution.doubts.empty() && !sources.accept_doubts) {
    std::cerr << "silhouette-calibrate: " << absl::StrJoin(solution.doubts, "; ")
              << "; --accept-doubts finds the poses nevertheless\nnothing was written" << std::endl;
    return kNo;
  }
  solution.warnings.insert(solution.warnings.end(), solution.doubts.begin(), solution.doubts.end());
  problem.views = seen;
  ASSIGN_OR_RETURN(
      const auto files,
      WritePoses(arguments.out, problem, solution,
                 {.command = "poses", .lenses = sources.cameras, .masks = masks}, false));
  nlohmann::ordered_json json = PosesJson(solution);
  json["files"] = files;
  PrintResult(arguments.format, json, PosesText(solution) + TextOfFiles(files));
  return kDone;
}

absl::StatusOr<ExitCode> PosesWork(const PosesArguments& arguments) {
  const PoseSources& sources = arguments.sources;
  if (!arguments.pairs.empty()) return PairsWork(arguments);
  if (sources.corners.empty() || sources.boards.empty()) {
    return InvalidArgument("give --corners and --boards, or --pairs");
  }
  ASSIGN_OR_RETURN(const PoseProblem problem, ReadPoseProblem(sources));
  ASSIGN_OR_RETURN(const auto masks, MaskSizesFrom(sources.cell, arguments.mask_size, problem));
  const auto start = std::chrono::steady_clock::now();
  const absl::StatusOr<PoseSolution> solution = CalibratePosesInSteps(problem);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  if (absl::IsFailedPrecondition(solution.status())) {
    for (const std::string& warning : problem.warnings) {
      std::cerr << "silhouette-calibrate: " << warning << "\n";
    }
    std::cerr << "silhouette-calibrate: " << solution.status().message();
    const std::string hint = HintOfUnit(sources, problem, std::string(solution.status().message()));
    if (!hint.empty()) std::cerr << "\n" << hint;
    std::cerr << "\nnothing was written" << std::endl;
    return kNo;
  }
  if (!solution.ok()) return solution.status();
  ASSIGN_OR_RETURN(
      const auto files,
      WritePoses(arguments.out, problem, *solution,
                 {.command = "poses", .lenses = sources.cameras, .masks = masks}, arguments.draw));
  nlohmann::ordered_json json = PosesJson(*solution);
  json["seconds"] = taken.count();
  json["files"] = files;
  PrintResult(arguments.format, json, PosesText(*solution) + TextOfFiles(files));
  return kDone;
}

struct ReportArguments {
  PoseSources sources;
  std::string workspace;
  int groups = 8;
  std::string out = "report.html";
  std::string json;
  std::string format = "text";
};

absl::StatusOr<ExitCode> ReportWork(const ReportArguments& arguments) {
  const PoseSources& sources = arguments.sources;
  ASSIGN_OR_RETURN(const PoseProblem problem, ReadPoseProblem(sources));
  ASSIGN_OR_RETURN(QualityReport report,
                   ReportOn(problem, sources, arguments.workspace, arguments.groups));
  if (!report.refusal.empty()) {
    const std::string hint = HintOfUnit(sources, problem, report.refusal);
    if (!hint.empty()) absl::StrAppend(&report.refusal, "; ", hint);
    for (const std::string& warning : problem.warnings) {
      std::cerr << "silhouette-calibrate: " << warning << "\n";
    }
    std::cerr << "silhouette-calibrate: " << report.refusal << std::endl;
  } else if (!report.doubts.empty()) {
    for (const std::string& doubt : report.doubts) {
      std::cerr << "silhouette-calibrate: " << doubt << std::endl;
    }
  } else if (!IsStable(report)) {
    std::cerr << "silhouette-calibrate: " << kNotStable << std::endl;
  }
  ASSIGN_OR_RETURN(const auto files, WriteReport(report, sources, arguments.out, arguments.json));
  nlohmann::ordered_json json = ReportJson(report);
  json["files"] = files;
  PrintResult(arguments.format, json, ReportText(report) + TextOfFiles(files));
  return IsStable(report) ? kDone : kNo;
}

}  // namespace

void AddPosesCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "poses",
      "Camera poses in the robot's base, from boards on the flange, surveyed and shared boards");
  auto arguments = std::make_shared<PosesArguments>();
  PosesArguments& a = *arguments;
  AddPoseSources(*command, a.sources);
  command->get_option("--cell")->description(
      "cell.yaml: the URDF for the pose of the flange, the views for the size of masks");
  // Not of pairs.
  for (const char* name : {"--corners", "--boards"}) command->get_option(name)->required(false);
  auto* pairs = command->add_option(
      "--pairs", a.pairs,
      "Instead of corners: VIEW=FILE of pairs of robot and board poses, as MoveIt or easy_handeye "
      "save them; once per view");
  command
      ->add_option("--mask-size", a.mask_size,
                   "WIDTHxHEIGHT of all views' masks, without --cell, for the matrices in "
                   "calibration.yaml")
      ->check(SizeInPixels());
  command
      ->add_option("--out", a.out,
                   "Folder for camera models, calibration.yaml, poses.json and residuals.csv")
      ->required();
  command->add_flag("--draw", a.draw, "Pictures of the residuals too, residuals_VIEW.png");
  for (const char* name :
       {"--corners", "--boards", "--sigma", "--robot-poses", "--joints", "--robot-sigma",
        "--least-frames", "--flange-board", "--standing", "--surveyed", "--draw"}) {
    pairs->excludes(command->get_option(name));
  }
  AddFormatOption(*command, a.format);
  command->footer(
      "All given data are solved together. Boards that are neither on the flange, surveyed nor "
      "standing are loose:\n"
      "they connect views that see them in the same frame.\n"
      "Exit code 1: the data give no reliable poses; the message states the reason.\n"
      "--pairs does not show errors of a lens, and a camera that moved only where one half of 16 "
      "or\n"
      "more pairs contradicts all of them.\n"
      "--pose-notation, numbers after the frame:\n"
      "  quaternion       tx ty tz qx qy qz qw    m; real part last\n"
      "  tum              the same, without a first line; the frame is the time stamp\n"
      "  rotation_vector  x y z rx ry rz          units to be stated; axis times angle\n"
      "  rpy              x y z roll pitch yaw    units to be stated; Rz(yaw) Ry(pitch) Rx(roll)\n"
      "  matrix           4 x 4 or 3 x 4, row by row    unit to be stated\n"
      "  kuka             x y z a b c             mm, deg; Rz(a) Ry(b) Rx(c)\n"
      "  abb              x y z q1 q2 q3 q4       mm; q1 is the real part\n"
      "  ur               x y z rx ry rz          m, rad; rotation vector\n"
      "  staubli          x y z rx ry rz          mm, deg; Rx(rx) Ry(ry) Rz(rz)\n"
      "  fanuc            x y z w p r             mm, deg; Rz(r) Ry(p) Rx(w)\n"
      "Examples:\n"
      "  silhouette-calibrate poses --corners corners.csv --boards boards.yaml --cameras lenses "
      "\\\n"
      "      --robot-poses poses.csv --flange-board flange --out cameras --draw\n"
      "  silhouette-calibrate poses --corners corners.csv --boards boards.yaml --cameras lenses "
      "\\\n"
      "      --joints joints.csv --cell cell.yaml --flange-board flange --surveyed survey.yaml "
      "--out cameras\n"
      "  silhouette-calibrate poses --corners corners.csv --boards boards.yaml --cameras lenses "
      "\\\n"
      "      --robot-poses krc.csv --pose-notation kuka --flange-board flange --out cameras\n"
      "  silhouette-calibrate poses --pairs left=samples.yaml --cameras lenses --out cameras");
  command->callback([arguments, &run] { run = [arguments] { return PosesWork(*arguments); }; });
}

void AddReportCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "report",
      "Report how good a calibration is, by images that it was not made from: one HTML page");
  auto arguments = std::make_shared<ReportArguments>();
  ReportArguments& a = *arguments;
  AddPoseSources(*command, a.sources);
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
      "Exit code 1: the data give no calibration, or one that other frames contradict; the page "
      "states the reason and shows what was seen.\n\n"
      "Example:\n"
      "  silhouette-calibrate report --corners corners.csv --boards boards.yaml --cameras lenses "
      "\\\n"
      "      --robot-poses poses.csv --flange-board flange --cell cell.yaml --out report.html");
  command->callback([arguments, &run] { run = [arguments] { return ReportWork(*arguments); }; });
}

}  // namespace silhouette
