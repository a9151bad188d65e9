// SPDX-License-Identifier: Apache-2.0
// The demo's cell keeps what the method asks for: the robot is whole in every view.
#include <gtest/gtest.h>

#include <numbers>

#include "capture/sim/contact.h"
#include "capture/sim/simulated_cell.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
const std::string kFolder = SourceFolder() + "/capture/sim/";

class DemoCell : public testing::Test {
 protected:
  const SimulationSettings settings_ =
      LoadSimulation(kFolder + "cells/demo/simulation.yaml").value();
  const RobotModel robot_ = RobotModel::FromUrdf(kFolder + "robots/rx130.urdf").value();
  const std::vector<BodyPart> parts_ = BodyPartsOf(robot_);

  // Joints 1 and 3 move; the others stand where the demo's cell.yaml puts them.
  Poses PosesAt(double joint_1, double joint_3) const {
    return robot_.LinkPoses(
        std::vector<double>{joint_1, 40 * kDegree, joint_3, 0, 20 * kDegree, 0});
  }
};

TEST_F(DemoCell, ArmHasTheSizeOfAnRx130) {
  const Poses upright = robot_.LinkPoses(std::vector<double>(6, 0.0));
  const auto link = [&](const std::string& name) -> Eigen::Vector3d {
    for (size_t i = 0; i < upright.size(); ++i) {
      if (robot_.links()[i].name == name) return upright[i].translation();
    }
    ADD_FAILURE() << name;
    return {};
  };
  EXPECT_NEAR((link("elbow") - link("upper_arm")).norm(), 0.625, 1e-9);
  EXPECT_NEAR((link("wrist") - link("elbow")).norm(), 0.625, 1e-9);
  EXPECT_EQ(robot_.joints().size(), 6u);
}

TEST_F(DemoCell, RobotIsWholeInEveryView) {
  constexpr double kMargin = 10;  // pixels: two of a mask of 64
  for (double joint_1 = -150; joint_1 <= 150; joint_1 += 10) {
    for (double joint_3 = -120; joint_3 <= 110; joint_3 += 10) {
      const Poses poses = PosesAt(joint_1 * kDegree, joint_3 * kDegree);
      for (const BodyPart& part : parts_) {
        for (const Eigen::Vector3d& vertex : part.mesh.vertices) {
          for (const SimulatedCamera& camera : settings_.cameras) {
            const auto pixel = camera.model.Project(poses[part.frame] * vertex);
            ASSERT_TRUE(pixel.has_value());
            const CameraIntrinsics& image = camera.model.intrinsics();
            ASSERT_TRUE(pixel->x() > kMargin && pixel->x() < image.width - 1 - kMargin &&
                        pixel->y() > kMargin && pixel->y() < image.height - 1 - kMargin)
                << camera.name << " at " << joint_1 << ", " << joint_3 << ": " << part.name;
          }
        }
      }
    }
  }
}

TEST_F(DemoCell, ArmNeverTouchesTheFloor) {
  for (double joint_3 = -120; joint_3 <= 110; joint_3 += 2) {
    const Poses poses = PosesAt(0, joint_3 * kDegree);
    for (const BodyPart& part : parts_) {
      if (part.name == "base") continue;
      for (const Eigen::Vector3d& vertex : part.mesh.vertices) {
        EXPECT_GT((poses[part.frame] * vertex).z(), 0.15) << part.name << " at " << joint_3;
      }
    }
  }
}

TEST_F(DemoCell, StraightWayIsBlockedAndAnotherIsFree) {
  const std::vector<Obstacle> obstacles =
      LoadObstacles(kFolder + "cells/demo/obstacles.yaml").value();
  const ContactChecker checker(robot_, obstacles);
  const Poses standing = ObstaclePoses(obstacles, 0);
  bool straight_is_free = true;
  for (double joint_1 = -115; joint_1 <= 115; joint_1 += 1) {
    if (checker.Check(PosesAt(joint_1 * kDegree, -20 * kDegree), standing).touching) {
      straight_is_free = false;
    }
    const Contact folded = checker.Check(PosesAt(joint_1 * kDegree, -80 * kDegree), standing);
    EXPECT_GT(folded.distance, 0.05) << "joint_1 at " << joint_1;
  }
  EXPECT_FALSE(straight_is_free);
}

}  // namespace
}  // namespace silhouette
