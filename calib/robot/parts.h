// SPDX-License-Identifier: Apache-2.0
// RobotParts: the links of a robot as convex parts, to be drawn.
//
// Primitive shapes are one part each. A mesh is its convex hull; where that adds too much, the mesh
// is cut by planes, and each piece is a hull: all triangles stay in the parts, whether the mesh is
// closed or not.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/robot_model.h"

namespace silhouette {

// Lengths in metres.
struct PartSettings {
  BodyGeometry geometry = BodyGeometry::kVisual;
  // By how much a point of the true robot's surface may be away from the model's. Robots agree with
  // their data sheets to a millimetre or two; covers and paint add as much.
  double tolerance = 0.005;
  // A mesh is cut while its hulls add more than this: a fifth of a pixel at 64 pixels over 3 m.
  double most_excess = 0.01;
  // Nor is it cut into more parts: each costs as much time as a whole convex link.
  size_t most_parts = 16;
  // A mesh with more triangles is refused: it would be cut for minutes.
  size_t most_triangles = 500'000;
};

class RobotParts {
 public:
  // InvalidArgument, in one sentence that names the link, its mesh and the mend: a mesh that is
  // flat or of too many triangles; a robot without any geometry.
  static absl::StatusOr<RobotParts> Of(const RobotModel& robot, const PartSettings& settings);

  const std::vector<RobotPart>& parts() const { return parts_; }

  // What the parts add, by link, metres: every straight line that meets a part of the link's
  // passes its shapes at no more than this distance. The tolerance is not in it.
  const std::vector<double>& excess() const { return excess_; }

 private:
  std::vector<RobotPart> parts_;
  std::vector<double> excess_;  // by link
};

// The robot as the cameras of `calibration` see it in masks of `mask_sizes`, a view each. `margin`:
// the calibration's error, mask pixels (PartDrawer). Joints as RobotModel::ChainOf has them. The
// parts are without the tolerance. InvalidArgument: the calibration has not a camera model for each
// view, the margin is negative or not finite, or as RobotParts::Of and ChainOf.
absl::StatusOr<DrawnRobot> DrawnRobotOf(const RobotModel& robot, const PartSettings& settings,
                                        std::span<const std::string> moving,
                                        std::span<const FixedJoint> fixed,
                                        const Calibration& calibration,
                                        std::span<const MaskSize> mask_sizes, double margin);

}  // namespace silhouette
