// SPDX-License-Identifier: Apache-2.0
// What is added to the robot that a cell draws.
#include "calib/robot/drawn_cell.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/calib/robot/drawing/random_robots.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// All joints but three are fixed, and stand anywhere within their tolerance.
TEST(DrawnCell, FixedJointsThatStandElsewhereHideNothingOfTheRobot) {
  constexpr double kDeviation = 0.03;
  Random random;
  size_t beyond = 0;     // without what fixed joints add
  size_t uncovered = 0;  // pixels that would be certain without it
  size_t certain = 0;
  for (int trial = 0; trial < std::max(SampleCount(12), 4); ++trial) {
    const RobotModel model = trial % 2 == 0 ? Rx130() : Gripper();
    const DrawnCell cell{.robot = std::make_shared<const RobotModel>(model),
                         .parts = {},
                         .fixed_joint_tolerance = kDeviation};
    DrawnCell exact = cell;
    exact.fixed_joint_tolerance = 0;
    std::vector<std::string> moving;
    std::vector<FixedJoint> stated;
    std::vector<FixedJoint> actual;
    std::vector<double> q;
    for (const RobotJoint& joint : model.joints()) {
      const double value = Uniform(random, joint.lower, joint.upper);
      if (moving.size() < 3 && random() % 2 == 0) {
        moving.push_back(joint.name);
        q.push_back(value);
        continue;
      }
      stated.push_back({joint.name, value});
      const double off = random() % 2 == 0 ? Uniform(random, -1, 1) : random() % 2 * 2.0 - 1;
      actual.push_back({joint.name, value + off * kDeviation});
    }
    const Calibration calibration{{CameraAbout(random), CameraAbout(random)}, {}};
    const std::vector<MaskSize> sizes(2, MaskSize{320, 240});
    const auto draw = [&](const DrawnCell& of, const std::vector<FixedJoint>& fixed) {
      return DrawnRobotOf(of, moving, fixed, calibration, sizes, 0).value();
    };
    const DrawnRobot drawn = draw(cell, stated);
    const DrawnRobot before = draw(exact, stated);
    const DrawnRobot truth = draw(exact, actual);
    const std::vector<Mask> touched = drawn.Touched(q);
    const std::vector<Mask> touched_before = before.Touched(q);
    std::vector<Eigen::Isometry3d> poses;
    truth.chain().Pose(q, poses);
    for (size_t view = 0; view < sizes.size(); ++view) {
      const CameraModel& camera = drawn.views()[view].camera();
      for (const RobotPart& part : truth.parts()) {
        for (const auto& point : part.points.colwise()) {
          const Eigen::Vector3d away = (part.radius - 1e-9) * RandomDirection(random);
          const auto at = camera.Project(poses[part.moves_with] * Eigen::Vector3d(point) + away);
          if (!at || !camera.Contains(*at)) continue;
          const int x = std::min(static_cast<int>(at->x() + 0.5), sizes[view].width - 1);
          const int y = std::min(static_cast<int>(at->y() + 0.5), sizes[view].height - 1);
          ASSERT_TRUE(touched[view].at(x, y)) << "trial " << trial;
          beyond += touched_before[view].at(x, y) ? 0 : 1;
        }
      }
      const Mask shown = truth.Touched(q)[view];
      const Mask covered = drawn.Covered(q)[view];
      EXPECT_TRUE((covered - shown).Empty()) << "trial " << trial;
      certain += covered.Count();
      uncovered += (before.Covered(q)[view] - shown).Count();
    }
  }
  EXPECT_GT(beyond, 10u);
  EXPECT_GT(uncovered, 0u);
  EXPECT_GT(certain, 100u);
}

TEST(DrawnCell, WhatHangsOnNoFixedJointIsNotGrown) {
  const RobotModel model = Rx130();
  const DrawnCell cell{.robot = std::make_shared<const RobotModel>(model), .parts = {}};
  EXPECT_EQ(cell.fixed_joint_tolerance, 0.005);
  std::vector<std::string> moving;
  for (const RobotJoint& joint : model.joints()) moving.push_back(joint.name);
  const FixedJoint elbow{moving[2], 0.2};
  moving.erase(moving.begin() + 2);
  size_t forearm = 0;
  while (model.links()[forearm].joint != 2) ++forearm;
  Random random;
  const Calibration calibration{{CameraAbout(random)}, {}};
  const std::vector<MaskSize> sizes(1, MaskSize{64, 64});
  const DrawnRobot drawn =
      DrawnRobotOf(cell, moving, std::vector<FixedJoint>{elbow}, calibration, sizes, 0).value();
  size_t grown = 0;
  for (const RobotPart& part : drawn.parts()) {
    const bool beyond = part.moves_with >= forearm;
    EXPECT_EQ(part.radius > cell.parts.tolerance, beyond) << part.moves_with;
    EXPECT_LT(part.radius, cell.parts.tolerance + 0.005 * 1.5) << "metres from the elbow";
    grown += beyond ? 1 : 0;
  }
  EXPECT_GT(grown, 0u);
  EXPECT_LT(grown, drawn.parts().size());
}

TEST(DrawnCell, LinksOfWhichNothingIsCertainAreNamed) {
  Random random;
  auto open = std::make_shared<TriangleMesh>(BoxMesh({0.4, 0.2, 0.1}));
  const std::vector<std::string> moving = {"turn", "lift", "slide"};
  const Calibration calibration{{CameraAbout(random)}, {}};
  const std::vector<MaskSize> sizes(1, MaskSize{64, 64});
  const auto uncertain = [&](const RobotModel& model) {
    std::vector<std::string> names;
    for (const RobotJoint& joint : model.joints()) names.push_back(joint.name);
    // A payload is uncertain, too, but not the link that carries it.
    const DrawnCell cell{
        .robot = std::make_shared<const RobotModel>(model), .parts = {}, .payload_radius = 0.1};
    return UncertainLinks(model, DrawnRobotOf(cell, names, {}, calibration, sizes, 0).value());
  };
  EXPECT_THAT(uncertain(Rx130()), IsEmpty());
  open->triangles.pop_back();
  const RobotModel bare =
      RobotModel::FromUrdf(WriteFile(FreshFolder() / "r.urdf",
                                     "<robot name='r'><link name='shell'/><link name='tool'/>"
                                     "<joint name='j' type='fixed'><parent link='shell'/>"
                                     "<child link='tool'/></joint></robot>"))
          .value();
  const LinkGeometry shell{
      .shape = MeshShape{"shell.stl", open}, .link_from_shape = {}, .colour = {}};
  const RobotModel with_shell = bare.WithBody(0, shell);
  EXPECT_THAT(uncertain(with_shell), ElementsAre("shell"));
  const LinkGeometry box{.shape = BoxShape{{0.2, 0.2, 0.2}}, .colour = {}};
  EXPECT_THAT(uncertain(with_shell.WithBody(0, box)), IsEmpty());
}

}  // namespace
}  // namespace silhouette
