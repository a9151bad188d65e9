#include "tools/silhouette-calibrate/poses_options.h"

#include "calib/poses/pose_calibration.h"

namespace silhouette {

void AddPoseSources(CLI::App& command, PoseSources& s, bool& degrees) {
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
                     "cell.yaml: its robot's URDF tells where the flange is, and its workspace");
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

PoseSources WithUnit(PoseSources sources, bool degrees) {
  sources.joint_unit = degrees ? AngleUnit::kDegrees : AngleUnit::kRadians;
  return sources;
}

std::string HintOfUnit(const PoseSources& sources) {
  if (sources.joints.empty()) return "";
  const bool degrees = sources.joint_unit == AngleUnit::kDegrees;
  const absl::StatusOr<PoseProblem> problem = ReadPoseProblem(WithUnit(sources, !degrees));
  if (!problem.ok() || !CalibratePoses(*problem).ok()) return "";
  return degrees ? "with joint values in radians (without --degrees) they fit"
                 : "with joint values in degrees (--degrees) they fit";
}

}  // namespace silhouette
