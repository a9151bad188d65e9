// What `silhouette-calibrate poses` reads.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"
#include "tools/program/joint_values.h"

namespace silhouette {

// Files and names; what is empty is not given.
struct PoseSources {
  std::string corners;
  std::string boards;
  std::string cameras;      // folder
  std::string robot_poses;  // CSV of poses, or
  std::string joints;       // CSV of joint values, with
  std::string cell;         // cell.yaml, or
  std::string urdf;
  AngleUnit joint_unit = AngleUnit::kRadians;  // of values that state none
  std::string flange_link;
  std::string flange_board;
  std::vector<std::string> standing_boards;
  std::string survey;
  std::string eye_in_hand;
  std::string robot_sigma;  // "0.2mm,0.02deg"
};

// InvalidArgument or NotFound in a sentence, with file and line where a file is wrong.
absl::StatusOr<PoseProblem> ReadPoseProblem(const PoseSources& sources);

}  // namespace silhouette
