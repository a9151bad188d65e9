// SPDX-License-Identifier: Apache-2.0
// An arm whose images are drawn, among balls: a base, a joint "turn" that turns without end, a
// joint "lift" and a slide "reach", seen by four cameras. What it touches is known exactly.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "calib/camera/calibration.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/collision_images.h"
#include "server/collision/obstacle_image.h"
#include "server/collision/robot_image_table.h"

namespace silhouette {

struct ArmBall {
  Eigen::Vector3d centre;
  double radius = 0;
};

class DrawnArm {
 public:
  static constexpr double kTolerance = 0.005;

  DrawnArm() : cameras_(Cameras()), robot_(Robot(cameras_)) {}

  static ConfigurationGrid Grid(int steps = 6) {
    return ConfigurationGrid({{.name = "turn",
                               .lower = -std::numbers::pi,
                               .upper = std::numbers::pi,
                               .steps = 2 * steps,
                               .continuous = true},
                              {.name = "lift", .lower = -2, .upper = 2, .steps = steps},
                              {.name = "reach", .lower = 0, .upper = 0.2, .steps = 2}});
  }

  const std::shared_ptr<const DrawnRobot>& robot() const { return robot_; }
  const std::vector<CameraModel>& cameras() const { return cameras_; }
  std::vector<MaskSize> sizes() const { return std::vector<MaskSize>(cameras_.size(), kSize); }

  RobotImageTable Table(int steps = 6, JointRegions forbidden = {}) const {
    return RobotImageTable::Drawn(Grid(steps), robot_, std::move(forbidden));
  }

  template <typename Random>
  static Configuration Any(Random& random) {
    const auto between = [&](double a, double b) {
      return std::uniform_real_distribution<double>(a, b)(random);
    };
    return {between(-4, 4), between(-2, 2), between(0, 0.2)};
  }

  // Whether the true arm touches the ball.
  bool Touches(const Configuration& q, const ArmBall& ball) const {
    std::vector<Eigen::Isometry3d> poses;
    robot_->chain().Pose(q, poses);
    for (size_t link = 0; link < poses.size(); ++link) {
      const Eigen::AlignedBox3d box = Boxes()[link];
      if (box.exteriorDistance(poses[link].inverse() * ball.centre) <= ball.radius) return true;
    }
    return false;
  }

  // What the cameras see of the balls while the arm stands at `now`, none of which it hides;
  // nothing if it does hide some.
  std::optional<ObstacleImages> See(const std::vector<ArmBall>& balls,
                                    const Configuration& now) const {
    ObstacleImages images;
    const std::vector<Mask> touched = robot_->Touched(now);
    const std::vector<Mask> covered = robot_->Covered(now);
    DrawingScratch scratch;
    for (size_t view = 0; view < cameras_.size(); ++view) {
      std::vector<uint64_t> words(kSize.words());
      for (const ArmBall& ball : balls) {
        robot_->views()[view].AddTouched(Eigen::Isometry3d::Identity(), ball.centre, {},
                                         ball.radius, scratch, words);
      }
      const Mask seen = Mask::FromWords(kSize, std::move(words));
      if (!(seen & touched[view]).Empty()) return std::nullopt;
      images.push_back(ObstacleImage::FromScene(seen | touched[view], touched[view],
                                                touched[view] & covered[view]));
    }
    return images;
  }

  // Some balls, and the arm where it hides none of them.
  template <typename Random>
  std::pair<std::vector<ArmBall>, ObstacleImages> SomeScene(Random& random, int count) const {
    const auto between = [&](double a, double b) {
      return std::uniform_real_distribution<double>(a, b)(random);
    };
    while (true) {
      std::vector<ArmBall> balls;
      for (int i = 0; i < count; ++i) {
        balls.push_back(
            {{between(-0.8, 0.8), between(-0.8, 0.8), between(0.1, 1.4)}, between(0.03, 0.12)});
      }
      const std::optional<ObstacleImages> images = See(balls, Any(random));
      if (images) return {balls, *images};
    }
  }

 private:
  static constexpr MaskSize kSize{64, 64};

  // Of every link, in its frame.
  static const std::vector<Eigen::AlignedBox3d>& Boxes() {
    using Eigen::Vector3d;
    static const std::vector<Eigen::AlignedBox3d> boxes = {
        {Vector3d(-0.15, -0.15, 0), Vector3d(0.15, 0.15, 0.2)},
        {Vector3d(-0.08, -0.08, 0), Vector3d(0.08, 0.08, 0.6)},
        {Vector3d(0, -0.06, -0.06), Vector3d(0.5, 0.06, 0.06)},
        {Vector3d(0, -0.04, -0.04), Vector3d(0.3, 0.04, 0.04)}};
    return boxes;
  }

  static Eigen::Matrix3Xd Corners(const Eigen::AlignedBox3d& box, double less) {
    Eigen::Matrix3Xd corners(3, 8);
    const Eigen::AlignedBox3d inner(box.min() + Eigen::Vector3d::Constant(less),
                                    box.max() - Eigen::Vector3d::Constant(less));
    for (int i = 0; i < 8; ++i) {
      corners.col(i) = inner.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i));
    }
    return corners;
  }

  static std::vector<CameraModel> Cameras() {
    std::vector<CameraModel> cameras;
    const Eigen::Vector3d at(0, 0, 0.7);
    for (int i = 0; i < 4; ++i) {
      const double angle = 0.3 + i * std::numbers::pi / 2;
      const Eigen::Vector3d centre(3 * std::cos(angle), 3 * std::sin(angle),
                                   i % 2 == 0 ? 2.5 : 1.2);
      Eigen::Matrix3d world_from_camera;
      world_from_camera.col(2) = (at - centre).normalized();
      world_from_camera.col(0) =
          world_from_camera.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
      world_from_camera.col(1) = world_from_camera.col(2).cross(world_from_camera.col(0));
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.linear() = world_from_camera;
      pose.translation() = centre;
      CameraIntrinsics in{.width = 64, .height = 64, .fx = 70, .fy = 70, .cx = 31.5, .cy = 31.5};
      in.distortion = {-0.1, 0.02, 0, 0, 0};
      cameras.emplace_back(in, pose.inverse());
    }
    return cameras;
  }

  static std::shared_ptr<const DrawnRobot> Robot(const std::vector<CameraModel>& cameras) {
    const auto link = [](int parent, int joint, const Eigen::Vector3d& at,
                         const Eigen::Vector3d& axis, bool slides) {
      ChainLink made{.parent = parent, .joint = joint, .slides = slides};
      made.parent_from_link.translation() = at;
      made.axis = axis;
      return made;
    };
    std::vector<ChainJoint> joints(3);
    joints[0] = {.name = "turn", .continuous = true};
    joints[1] = {.name = "lift", .lower = -2, .upper = 2};
    joints[2] = {.name = "reach", .lower = 0, .upper = 0.2};
    KinematicChain chain(
        joints,
        {link(-1, -1, {0, 0, 0}, {0, 0, 1}, false), link(0, 0, {0, 0, 0.2}, {0, 0, 1}, false),
         link(1, 1, {0, 0, 0.6}, {0, 1, 0}, false), link(2, 2, {0.4, 0, 0}, {1, 0, 0}, true)});
    std::vector<RobotPart> parts;
    for (size_t i = 0; i < Boxes().size(); ++i) {
      parts.push_back({.link = i,
                       .moves_with = i,
                       .points = Corners(Boxes()[i], 0),
                       .radius = kTolerance,
                       .inner = Corners(Boxes()[i], kTolerance)});
    }
    std::vector<PartDrawer> views;
    for (const CameraModel& camera : cameras) views.emplace_back(camera, kSize);
    return std::make_shared<const DrawnRobot>(std::move(chain), std::move(parts), std::move(views));
  }

  std::vector<CameraModel> cameras_;
  std::shared_ptr<const DrawnRobot> robot_;
};

}  // namespace silhouette
