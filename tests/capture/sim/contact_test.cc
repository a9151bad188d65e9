// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/contact.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tests/capture/sim/small_cell.h"
#include "tests/random.h"

namespace silhouette {
namespace {

Contact Check(const RobotModel& robot, const std::vector<Obstacle>& obstacles,
              const std::vector<double>& positions) {
  return ContactChecker(robot, obstacles)
      .Check(robot.LinkPoses(positions), ObstaclePoses(obstacles, 0));
}

Obstacle SphereAt(const std::string& name, double radius, const Eigen::Vector3d& position) {
  Obstacle sphere = BoxAt(name, {1, 1, 1}, position);
  sphere.mesh = SphereMesh(radius);
  return sphere;
}

TEST(Contact, DistanceIsThatOfTheNearestSurfaces) {
  const RobotModel robot = ThreeJointRobot();
  // The tool's ball of 0.05 is at (0.9, 0, 1); the box begins at x = 1.2.
  const Contact contact =
      Check(robot, {BoxAt("far", {1, 1, 1}, {9, 0, 1}), BoxAt("near", {0.2, 1, 1}, {1.3, 0, 1})},
            {0, 0, 0});
  EXPECT_FALSE(contact.touching);
  EXPECT_NEAR(contact.distance, 0.25, 1e-4);
  EXPECT_EQ(contact.link, "tool");
  EXPECT_EQ(contact.obstacle, "near");
}

TEST(Contact, TurningIntoTheObstacleTouches) {
  const RobotModel robot = ThreeJointRobot();
  const std::vector<Obstacle> obstacles{BoxAt("box", {0.2, 0.2, 0.2}, {0, 0.8, 1})};
  EXPECT_FALSE(Check(robot, obstacles, {0, 0, 0}).touching);
  const Contact contact = Check(robot, obstacles, {std::numbers::pi / 2, 0, 0});
  EXPECT_TRUE(contact.touching);
  EXPECT_EQ(contact.distance, 0);
  EXPECT_EQ(contact.obstacle, "box");
}

TEST(Contact, TouchesSaysWhatCheckSaysAndPointsLieInBoth) {
  const RobotModel robot = ThreeJointRobot();
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> number(-1, 1);
  int touching = 0;
  for (int i = 0; i < 300; ++i) {
    const std::vector<Obstacle> obstacles{
        BoxAt("box", {0.3, 0.2, 0.4}, {number(random), number(random), 1 + number(random) / 2}),
        SphereAt("ball", 0.15, {number(random), number(random), 1 + number(random) / 2})};
    const ContactChecker contact(robot, obstacles);
    const Poses links =
        robot.LinkPoses(std::vector<double>{2 * number(random), 3 * number(random), 0.1});
    const Poses poses = ObstaclePoses(obstacles, 0);
    const bool touches = contact.Check(links, poses).touching;
    EXPECT_EQ(contact.Touches(links, poses), touches);
    const std::vector<ContactPoint> points = contact.Points(links, poses, 10);
    EXPECT_EQ(points.empty(), !touches);
    for (const ContactPoint& point : points) {
      if (point.obstacle != "ball") continue;
      EXPECT_LT((point.point - obstacles[1].world_from_obstacle.translation()).norm(), 0.16);
    }
    touching += touches ? 1 : 0;
  }
  EXPECT_GT(touching, 20);
}

TEST(Contact, ObstacleThatSwallowsTheRobotTouches) {
  EXPECT_TRUE(Check(ThreeJointRobot(), {BoxAt("hall", {9, 9, 9}, {0, 0, 0})}, {0, 0, 0}).touching);
}

TEST(Contact, ObstacleInsideTheRobotTouches) {
  // Wholly inside the upper arm, a box of 0.5 x 0.1 x 0.2 around (0.25, 0, 1).
  const Contact contact =
      Check(ThreeJointRobot(), {SphereAt("bolt", 0.01, {0.25, 0, 1})}, {0, 0, 0});
  EXPECT_TRUE(contact.touching);
  EXPECT_EQ(contact.link, "upper");
}

TEST(Contact, WithoutObstaclesNothingIsNear) {
  const Contact contact = Check(ThreeJointRobot(), {}, {0, 0, 0});
  EXPECT_FALSE(contact.touching);
  EXPECT_TRUE(std::isinf(contact.distance));
  EXPECT_EQ(contact.obstacle, "");
}

// The tool alone against spheres: ball against ball is easily said otherwise.
TEST(Contact, AgreesWithBallsOnTheTool) {
  Random random;
  const RobotModel robot = ThreeJointRobot();
  std::uniform_real_distribution<double> angle(-2, 2), slide(0, 0.3), beyond(0.01, 0.5);
  for (int i = 0; i < 50; ++i) {
    const std::vector<double> positions{angle(random), angle(random), slide(random)};
    const Poses poses = robot.LinkPoses(positions);
    // Straight ahead of the tool, so that nothing else is nearer.
    const double gap = beyond(random);
    const Eigen::Vector3d centre = poses[3] * Eigen::Vector3d(0.05 + gap + 0.1, 0, 0);
    const Contact contact = Check(robot, {SphereAt("ball", 0.1, centre)}, positions);
    // Inscribed polyhedra: a little farther apart than the balls that they stand for.
    EXPECT_GE(contact.distance, gap - 1e-9);
    EXPECT_LE(contact.distance, gap + 0.002);
    EXPECT_EQ(contact.link, "tool");
  }
}

class MotionContactTest : public testing::Test {
 protected:
  MotionContact Check(const std::vector<Obstacle>& obstacles, const std::vector<double>& from,
                      const std::vector<double>& to) const {
    const ContactChecker checker(robot_, obstacles);
    return MotionChecker(robot_, checker).Check(from, to, ObstaclePoses(obstacles, 0));
  }
  const RobotModel robot_ = ThreeJointRobot();
};

TEST_F(MotionContactTest, ThinObstacleBetweenTwoFreeConfigurationsIsFound) {
  const std::vector<Obstacle> rod{BoxAt("rod", {0.002, 0.002, 3}, {0, 0.7, 1})};
  const MotionContact motion = Check(rod, {0, 0, 0}, {2, 0, 0});
  EXPECT_TRUE(motion.contact.touching);
  // The arm lies along y at a quarter turn; it is 0.06 wide where it meets the rod.
  EXPECT_NEAR(motion.positions[0], std::numbers::pi / 2, 0.1);
  EXPECT_NEAR(motion.fraction, motion.positions[0] / 2, 1e-12);
}

TEST_F(MotionContactTest, FreeMotionTellsItsNarrowestPlace) {
  const std::vector<Obstacle> rod{BoxAt("rod", {0.02, 0.02, 3}, {0, 1.2, 1})};
  const MotionContact motion = Check(rod, {0, 0, 0}, {2, 0, 0});
  EXPECT_FALSE(motion.contact.touching);
  EXPECT_NEAR(motion.contact.distance, 1.19 - 0.95, 0.005);
  EXPECT_NEAR(motion.positions[0], std::numbers::pi / 2, 0.05);
}

TEST_F(MotionContactTest, ContinuousJointTakesTheWayThatItsValuesSay) {
  // `bend` is continuous: from 3 to -3 it passes 0, where the forearm meets the box ahead; the same
  // place by the other way round passes pi, where it points back.
  const std::vector<Obstacle> ahead{BoxAt("box", {0.1, 0.1, 0.1}, {0.8, 0, 1})};
  EXPECT_TRUE(Check(ahead, {0, 3, 0}, {0, -3, 0}).contact.touching);
  EXPECT_FALSE(Check(ahead, {0, 3, 0}, {0, 2 * std::numbers::pi - 3, 0}).contact.touching);
  EXPECT_TRUE(Check(ahead, {0, 1.5, 0}, {0, -1.5, 0}).contact.touching);
}

TEST_F(MotionContactTest, StandingStillIsAMotionToo) {
  const std::vector<Obstacle> box{BoxAt("box", {0.1, 0.1, 0.1}, {0.8, 0, 1})};
  EXPECT_TRUE(Check(box, {0, 0, 0}, {0, 0, 0}).contact.touching);
  EXPECT_FALSE(Check({}, {0, 0, 0}, {0, 0, 0}).contact.touching);
}

}  // namespace
}  // namespace silhouette
