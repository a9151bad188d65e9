// The robot's poses as a CSV file, a line per frame:
//
//   frame,tx,ty,tz,qx,qy,qz,qw
//   0007,0.41,-0.12,0.63,0.707,0.707,0,0
//
// base_from_flange: metres, and a quaternion with its real part last.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

std::string RobotPoseFileText(const std::vector<RobotPose>& poses);

// In the order of the file. `file`: what messages call it. InvalidArgument with file and line: not
// such a table, a frame without name or there twice, a quaternion whose length is not 1 within a
// hundredth (it is made 1), positions that can only be millimetres.
absl::StatusOr<std::vector<RobotPose>> RobotPosesFromText(const std::string& text,
                                                          const std::string& file);

}  // namespace silhouette
