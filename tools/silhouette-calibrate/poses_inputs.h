// SPDX-License-Identifier: Apache-2.0
// What `poses`, `report` and `run` read.
#pragma once

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"
#include "tools/program/joint_values.h"

namespace silhouette {

// Files and names; empty: not given.
struct PoseSources {
  std::string corners;
  double sigma = 0;  // of corners, as for ReadSightings
  std::string boards;
  std::string cameras;      // folder
  std::string robot_poses;  // a file of poses, or a pattern or folder of files of one each, or
  std::string joints;       // CSV of joint values, with
  std::string cell;         // cell.yaml, or
  std::string urdf;
  std::string pose_notation = "quaternion";  // as PoseNotation::Named, of robot_poses
  std::string pose_units;
  AngleUnit joint_unit = AngleUnit::kRadians;  // of values that state none
  std::string flange_link;
  std::string flange_board;
  std::vector<std::string> standing_boards;
  std::string survey;
  std::string eye_in_hand;
  std::string robot_sigma;  // "0.2mm,0.02deg"
  SizeTrust size_trust = SizeTrust::kNeither;
  int least_frames = PoseProblem().least_frames;
  bool accept_doubts = false;
};

// InvalidArgument or NotFound in a sentence, with file and line where a file is wrong.
absl::StatusOr<PoseProblem> ReadPoseProblem(const PoseSources& sources);

// The views: the camera models, and which is on the flange. Errors as ReadPoseProblem.
absl::Status ReadViews(const PoseSources& sources, PoseProblem& problem);

void AddPoseSources(CLI::App& command, PoseSources& sources);

// For a problem of these sources that gives no calibration: a sentence, if joint values in the
// other unit would give one, or, where the refusal guesses no reason, poses in another notation;
// else empty.
std::string HintOfUnit(const PoseSources& sources, PoseProblem problem, const std::string& refusal);

struct WorkspacePoints {
  std::vector<Eigen::Vector3d> points;  // in the base, metres; none: unknown
  std::string name;                     // in words
};

// `box`: "x0:x1,y0:y1,z0:z1" in metres, or empty: then where the links of the robot get by its
// model, over the joints of the cell's grid or all; else the cell's workspace. InvalidArgument: not
// such a box; the errors of LoadCell and RobotModel::FromUrdf.
absl::StatusOr<WorkspacePoints> WorkspacePointsOf(const PoseSources& sources,
                                                  const std::string& box);

}  // namespace silhouette
