// SPDX-License-Identifier: Apache-2.0
// A small cell whose robot images are drawn: four views, a joint "turn" without end, a joint "lift"
// (-2 to 2) and a fixed joint "reach" at 0.1. Its grid has hardly a step.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "calib/robot/drawn_cell.h"
#include "calib/robot/robot_model.h"
#include "db/store/store.h"
#include "server/scene/make_scene.h"
#include "server/scene/served_database.h"
#include "tests/test_folder.h"

namespace silhouette {

inline constexpr MaskSize kDrawnSize{64, 64};

// A base, a joint that turns without end, one that lifts, and a slide that is fixed.
inline RobotModel DrawnModel() {
  const std::string urdf = R"(<robot name='arm'>
  <link name='base'><visual><geometry><box size='0.3 0.3 0.2'/></geometry>
    <origin xyz='0 0 0.1'/></visual></link>
  <link name='post'><visual><geometry><box size='0.16 0.16 0.6'/></geometry>
    <origin xyz='0 0 0.3'/></visual></link>
  <link name='beam'><visual><geometry><box size='0.5 0.12 0.12'/></geometry>
    <origin xyz='0.25 0 0'/></visual></link>
  <link name='tip'><visual><geometry><box size='0.3 0.08 0.08'/></geometry>
    <origin xyz='0.15 0 0'/></visual></link>
  <joint name='turn' type='continuous'><parent link='base'/><child link='post'/>
    <origin xyz='0 0 0.2'/><axis xyz='0 0 1'/></joint>
  <joint name='lift' type='revolute'><parent link='post'/><child link='beam'/>
    <origin xyz='0 0 0.6'/><axis xyz='0 1 0'/>
    <limit lower='-2' upper='2' effort='1' velocity='1'/></joint>
  <joint name='reach' type='prismatic'><parent link='beam'/><child link='tip'/>
    <origin xyz='0.4 0 0'/><axis xyz='1 0 0'/>
    <limit lower='0' upper='0.2' effort='1' velocity='1'/></joint>
</robot>)";
  const std::filesystem::path path = FreshFolder() / "arm.urdf";
  std::ofstream(path) << urdf;
  return RobotModel::FromUrdf(path.string()).value();
}

inline Calibration DrawnCalibration() {
  Calibration calibration;
  for (int i = 0; i < 4; ++i) {
    const double angle = 0.3 + i * std::numbers::pi / 2;
    const Eigen::Vector3d centre(3 * std::cos(angle), 3 * std::sin(angle), i % 2 == 0 ? 2.5 : 1.2);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear().col(2) = (Eigen::Vector3d(0, 0, 0.7) - centre).normalized();
    pose.linear().col(0) = pose.linear().col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
    pose.linear().col(1) = pose.linear().col(2).cross(pose.linear().col(0));
    pose.translation() = centre;
    calibration.cameras.emplace_back(
        CameraIntrinsics{.width = 64, .height = 64, .fx = 70, .fy = 70, .cx = 31.5, .cy = 31.5},
        pose.inverse());
  }
  return calibration;
}

inline storage::v1::CellDescription DrawnCellDescription() {
  storage::v1::CellDescription cell;
  cell.set_name("drawn");
  storage::v1::GridJoint& turn = *cell.add_grid_joints();
  turn.set_name("turn");
  turn.set_lower(-std::numbers::pi);
  turn.set_upper(std::numbers::pi);
  turn.set_steps(3);
  turn.set_continuous(true);
  storage::v1::GridJoint& lift = *cell.add_grid_joints();
  lift.set_name("lift");
  lift.set_lower(-2);
  lift.set_upper(2);
  lift.set_steps(2);
  storage::v1::FixedJoint& reach = *cell.add_fixed_joints();
  reach.set_name("reach");
  reach.set_position(0.1);
  for (int i = 0; i < 4; ++i) {
    storage::v1::View& view = *cell.add_views();
    view.set_name(std::string(1, static_cast<char>('a' + i)));
    view.set_image_width(64);
    view.set_image_height(64);
    view.set_mask_width(64);
    view.set_mask_height(64);
  }
  return cell;
}

struct DrawnCellBall {
  Eigen::Vector3d centre;
  double radius = 0;
};

// What the cameras see of the robot `truth`, with the joints of the grid at `now`, and of balls.
inline SceneInput DrawnSceneInput(const DrawnRobot& truth, const Configuration& now,
                                  const std::vector<DrawnCellBall>& balls) {
  SceneInput input;
  input.joints = {{"turn", now[0]}, {"lift", now[1]}, {"reach", 0.1}};
  const std::vector<Mask> robot = truth.Touched(now);
  DrawingScratch scratch;
  for (size_t view = 0; view < robot.size(); ++view) {
    std::vector<uint64_t> words(kDrawnSize.words());
    for (const DrawnCellBall& ball : balls) {
      truth.views()[view].AddTouched(Eigen::Isometry3d::Identity(), ball.centre, {}, ball.radius,
                                     scratch, words);
    }
    const Mask seen = Mask::FromWords(kDrawnSize, std::move(words));
    input.views.push_back({std::string(1, static_cast<char>('a' + view)), std::nullopt,
                           SceneMask{seen | robot[view]}});
  }
  return input;
}

}  // namespace silhouette
