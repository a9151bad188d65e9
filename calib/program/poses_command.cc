// silhouette-calibrate poses
#include <chrono>
#include <iostream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "calib/poses/pose_calibration.h"
#include "calib/program/commands.h"
#include "calib/program/poses_inputs.h"
#include "calib/program/poses_results.h"
#include "tools/program/program.h"

namespace silhouette {
namespace {

struct Arguments {
  PoseSources sources;
  bool degrees = false;
  std::string mask_size;
  std::string out;
  bool draw = false;
  std::string format = "text";
};

AngleUnit Other(AngleUnit unit) {
  return unit == AngleUnit::kRadians ? AngleUnit::kDegrees : AngleUnit::kRadians;
}

// Whether joint values taken in the other unit make a calibration of data that make none.
bool FitsInOtherUnit(PoseSources sources) {
  if (sources.joints.empty()) return false;
  sources.joint_unit = Other(sources.joint_unit);
  const absl::StatusOr<PoseProblem> problem = ReadPoseProblem(sources);
  return problem.ok() && CalibratePoses(*problem).ok();
}

absl::StatusOr<ExitCode> Work(const Arguments& arguments) {
  PoseSources sources = arguments.sources;
  if (arguments.degrees) sources.joint_unit = AngleUnit::kDegrees;
  const absl::StatusOr<PoseProblem> problem = ReadPoseProblem(sources);
  if (!problem.ok()) return problem.status();
  const auto masks = MaskSizesFrom(sources.cell, arguments.mask_size, *problem);
  if (!masks.ok()) return masks.status();
  const auto start = std::chrono::steady_clock::now();
  const absl::StatusOr<PoseSolution> solution = CalibratePoses(*problem);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  if (absl::IsFailedPrecondition(solution.status())) {
    std::cerr << "silhouette-calibrate: " << solution.status().message();
    if (FitsInOtherUnit(sources)) {
      std::cerr << (arguments.degrees
                        ? "\nwith joint values in radians (without --degrees) they fit"
                        : "\nwith joint values in degrees (--degrees) they fit");
    }
    std::cerr << "\nnothing was written" << std::endl;
    return kNo;
  }
  if (!solution.ok()) return solution.status();
  const auto files =
      WritePoses(arguments.out, *problem, *solution,
                 {.command = "poses", .lenses = sources.cameras, .masks = *masks}, arguments.draw);
  if (!files.ok()) return files.status();
  if (arguments.format == "json") {
    nlohmann::ordered_json json = PosesJson(*solution);
    json["seconds"] = taken.count();
    json["files"] = *files;
    std::cout << json.dump(2) << '\n';
    return kDone;
  }
  PrintPoses(*solution);
  for (const std::string& file : *files) std::cout << "wrote " << file << '\n';
  return kDone;
}

void AddSources(CLI::App& command, PoseSources& s, bool& degrees) {
  command.add_option("--corners", s.corners, "Corners of tags (CSV)")->required();
  command.add_option("--boards", s.boards, "The boards (YAML)")->required();
  command
      .add_option("--cameras", s.cameras,
                  "Folder of camera models, VIEW.cameramodel, for their lenses")
      ->required();
  auto* poses = command.add_option("--robot-poses", s.robot_poses,
                                   "The robot's poses, base_from_flange (CSV: "
                                   "frame,tx,ty,tz,qx,qy,qz,qw; metres)");
  auto* joints = command
                     .add_option("--joints", s.joints,
                                 "Instead: its joint values (CSV: frame and the joints' names)")
                     ->excludes(poses);
  command.add_flag("--degrees", degrees, "Joint values without a unit are degrees")->needs(joints);
  command.add_option("--cell", s.cell,
                     "cell.yaml: its robot's URDF tells where the flange is, its views how large "
                     "masks are");
  command.add_option("--urdf", s.urdf, "Instead: the robot's URDF")
      ->needs(joints)
      ->excludes("--cell");
  command
      .add_option("--flange-link", s.flange_link,
                  "The link that carries the board or camera; default: 'flange', else the last")
      ->needs(joints);
  command.add_option("--robot-sigma", s.robot_sigma,
                     "How exactly the robot goes where it says, per axis; default: 0.2mm,0.02deg");
  command.add_option("--flange-board", s.flange_board, "The board on the flange");
  command.add_option("--standing", s.standing_boards,
                     "A board that stands still through all frames, no one knows where");
  command.add_option("--surveyed", s.survey, "Where boards stand in the base (YAML)");
  command.add_option("--eye-in-hand", s.eye_in_hand,
                     "The view on the flange; boards stand still then");
}

}  // namespace

void AddPosesCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "poses",
      "Camera poses in the robot's base, from boards on the flange, surveyed and shared boards");
  auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  AddSources(*command, a.sources, a.degrees);
  command->add_option("--mask-size", a.mask_size,
                      "WIDTHxHEIGHT of all views' masks, where no cell says it, for the matrices "
                      "in calibration.yaml");
  command
      ->add_option("--out", a.out,
                   "Folder for camera models, calibration.yaml, poses.json and residuals.csv")
      ->required();
  command->add_flag("--draw", a.draw, "Pictures of the residuals too, residuals_VIEW.png");
  AddFormatOption(*command, a.format);
  command->footer(
      "What is given is solved together. Boards that are neither on the flange, surveyed nor "
      "standing are loose:\n"
      "they tie views that see them in one frame.\n"
      "Exit code 1: the data give no poses that one could trust; the reason is said.\n"
      "Examples:\n"
      "  silhouette-calibrate poses --corners corners.csv --boards boards.yaml --cameras lenses "
      "\\\n"
      "      --robot-poses poses.csv --flange-board flange --out cameras --draw\n"
      "  silhouette-calibrate poses --corners corners.csv --boards boards.yaml --cameras lenses "
      "\\\n"
      "      --joints joints.csv --cell cell.yaml --flange-board flange --surveyed survey.yaml "
      "--out cameras");
  command->callback([arguments, &run] {
    run = [arguments]() -> int {
      const absl::StatusOr<ExitCode> code = Work(*arguments);
      return code.ok() ? *code : Report("silhouette-calibrate", code.status());
    };
  });
}

}  // namespace silhouette
