// The points of the robot's workspace by which a report judges cameras.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/silhouette-calibrate/poses_inputs.h"

namespace silhouette {

struct WorkspacePoints {
  std::vector<Eigen::Vector3d> points;  // in the base, metres; none: nothing is known
  std::string name;                     // what they are, in words
};

// `box`: "x0:x1,y0:y1,z0:z1" in metres, or empty: then where the links of the robot get by its
// model, over the joints of the cell's grid or all; else the cell's workspace. InvalidArgument: not
// such a box; the errors of LoadCell and RobotModel::FromUrdf.
absl::StatusOr<WorkspacePoints> WorkspacePointsOf(const PoseSources& sources,
                                                  const std::string& box);

}  // namespace silhouette
