// The robot's joint values as a CSV file: a column `frame`, and one per joint by its name.
//
//   frame,joint_1,joint_2,joint_3
//   0007,0.5,-30deg,1.2
//
// Values are radians (prismatic: metres) unless they state a unit.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"
#include "calib/robot/fixed_joint.h"
#include "calib/robot/robot_model.h"
#include "tools/program/joint_values.h"

namespace silhouette {

struct JointFileSettings {
  std::vector<FixedJoint> fixed_joints;  // of joints that have no column
  AngleUnit unit = AngleUnit::kRadians;  // of values that state none
  std::string flange_link;               // empty: the link `flange`, else the last one
};

// base_from_flange of every line, in the order of the file. InvalidArgument with file and line: a
// joint that is missing or unknown, a frame twice, a value that is none, beyond its limits or looks
// like degrees.
absl::StatusOr<std::vector<RobotPose>> RobotPosesOfJoints(const std::string& text,
                                                          const std::string& file,
                                                          const RobotModel& robot,
                                                          const JointFileSettings& settings);

}  // namespace silhouette
