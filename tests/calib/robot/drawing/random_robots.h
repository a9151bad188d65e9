// SPDX-License-Identifier: Apache-2.0
// Robots and cameras about them, for tests of what is drawn of whole robots.
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/parts.h"
#include "calib/robot/robot_model.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/folders.h"
#include "tests/random.h"

namespace silhouette {

inline constexpr double kTolerance = 0.005;  // of drawn parts

inline RobotModel Rx130() {
  return RobotModel::FromUrdf(SourceFolder() + "/capture/sim/robots/rx130.urdf").value();
}

// Three joints, with bodies like an egg's and a bent one's on every link.
inline RobotModel OfMeshes(Random& random) {
  RobotModel robot = ThreeJoints();
  for (size_t link = 0; link < robot.links().size(); ++link) {
    const Eigen::Vector3d size(Uniform(random, 0.05, 0.2), Uniform(random, 0.05, 0.2),
                               Uniform(random, 0.1, 0.4));
    auto mesh = std::make_shared<TriangleMesh>(link % 2 == 0 ? SphereMesh(1) : BoxMesh({2, 2, 2}));
    for (Eigen::Vector3d& vertex : mesh->vertices) {
      vertex = vertex.cwiseProduct(size).eval();
      vertex.x() += 2 * vertex.z() * vertex.z();
    }
    robot = robot.WithBody(link, {.shape = MeshShape{"body.stl", mesh},
                                  .link_from_shape = RandomPose(random, {0.1, 0, 0}),
                                  .colour = {}});
  }
  return robot;
}

inline std::vector<double> RandomPositions(Random& random, const RobotModel& robot) {
  std::vector<double> positions;
  for (const RobotJoint& joint : robot.joints()) {
    positions.push_back(Uniform(random, joint.lower, joint.upper));
  }
  return positions;
}

// A camera of random lens that looks at the robot from a random side.
inline CameraModel CameraAbout(Random& random) {
  const Eigen::Vector3d centre =
      Eigen::Vector3d(0, 0, 0.8) + Uniform(random, 1.8, 4.5) * RandomDirection(random);
  const Eigen::Vector3d along = (Eigen::Vector3d(0, 0, 0.8) - centre).normalized();
  Eigen::Matrix3d world_from_camera;
  world_from_camera.col(2) = along;
  world_from_camera.col(0) = along.cross(RandomDirection(random)).normalized();
  world_from_camera.col(1) = along.cross(world_from_camera.col(0));
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = world_from_camera;
  pose.translation() = centre;
  return RandomCamera(random, pose.inverse());
}

inline KinematicChain ChainOf(const RobotModel& robot) {
  std::vector<std::string> moving;
  for (const RobotJoint& joint : robot.joints()) moving.push_back(joint.name);
  return robot.ChainOf(moving, {}).value();
}

inline DrawnRobot Drawn(const RobotModel& robot, std::vector<PartDrawer> views) {
  PartSettings settings;
  settings.tolerance = kTolerance;
  return {ChainOf(robot), RobotParts::Of(robot, settings).value().parts(), std::move(views)};
}

}  // namespace silhouette
