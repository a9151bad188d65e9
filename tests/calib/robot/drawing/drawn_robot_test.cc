// SPDX-License-Identifier: Apache-2.0
// Drawn images of whole robots: compared with dense samples of their true, grown surfaces.
#include "calib/robot/drawing/drawn_robot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "calib/robot/parts.h"
#include "calib/robot/robot_model.h"
#include "tests/calib/robot/drawing/random_robots.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// A point of the true surface, in the shape's frame.
Vector3d PointOf(Random& random, const Shape& shape) {
  if (const auto* cylinder = std::get_if<CylinderShape>(&shape)) {
    const double angle = Uniform(random, 0, 2 * std::numbers::pi);
    const double half = cylinder->length / 2;
    const double z = random() % 2 == 0 ? half : Uniform(random, -half, half);
    return {cylinder->radius * std::cos(angle), cylinder->radius * std::sin(angle),
            random() % 2 == 0 ? z : -z};
  }
  if (const auto* sphere = std::get_if<SphereShape>(&shape)) {
    return sphere->radius * RandomDirection(random);
  }
  if (const auto* mesh = std::get_if<MeshShape>(&shape)) return SurfacePoint(random, *mesh->mesh);
  return SurfacePoint(random, Tessellate(shape));
}

struct Tally {
  size_t missing = 0;
  size_t samples = 0;
  size_t drawn = 0;
  size_t touched = 0;  // by a sample, or between two in a row of 64 pixels
};

void Compare(Random& random, const RobotModel& robot, const DrawnRobot& drawn, int samples,
             Tally& tally) {
  const std::vector<double> q = RandomPositions(random, robot);
  const std::vector<Isometry3d> poses = robot.LinkPoses(q);
  const double growth = kTolerance + (random() % 2 == 0 ? 0 : 0.03);
  const std::vector<Mask> masks = drawn.Touched(q, growth);
  for (size_t view = 0; view < drawn.views().size(); ++view) {
    const Mask& mask = masks[view];
    const CameraModel& camera = drawn.views()[view].camera();
    std::vector<bool> touched(mask.size().pixels());
    for (size_t link = 0; link < poses.size(); ++link) {
      for (const LinkGeometry& geometry : robot.links()[link].body()) {
        for (int i = 0; i < samples; ++i) {
          const Vector3d point =
              poses[link] * geometry.link_from_shape * PointOf(random, geometry.shape) +
              growth * RandomDirection(random);
          const auto at = camera.Project(point);
          if (!at || !camera.Contains(*at)) continue;
          const int x = std::min(static_cast<int>(at->x() + 0.5), mask.width() - 1);
          const int y = std::min(static_cast<int>(at->y() + 0.5), mask.height() - 1);
          ++tally.samples;
          if (!mask.at(x, y)) ++tally.missing;
          touched[static_cast<size_t>(y * mask.width() + x)] = true;
        }
      }
    }
    tally.drawn += mask.Count();
    for (const bool set : touched) tally.touched += set ? 1 : 0;
  }
}

TEST(DrawnRobot, NoPixelOfTheRobotIsMissing) {
  Random random;
  Tally tally;
  for (int trial = 0; trial < 12; ++trial) {
    const RobotModel robot = trial % 3 == 2   ? OfMeshes(random)
                             : trial % 3 == 1 ? Gripper()
                                              : Rx130();
    std::vector<PartDrawer> views;
    for (int view = 0; view < 3; ++view) {
      views.emplace_back(CameraAbout(random), RandomMaskSize(random));
    }
    const DrawnRobot drawn = Drawn(robot, views);
    for (int i = 0; i < 4; ++i) Compare(random, robot, drawn, SampleCount(150), tally);
  }
  EXPECT_EQ(tally.missing, 0u);
  EXPECT_GT(tally.samples, static_cast<size_t>(SampleCount(110000)));
}

TEST(DrawnRobot, FewPixelsAreDrawnThatTheRobotDoesNotTouch) {
  Random random;
  Tally tally;
  const RobotModel robot = Rx130();
  for (int trial = 0; trial < 4; ++trial) {
    CameraIntrinsics in{.width = 64, .height = 64, .fx = 70, .fy = 70, .cx = 31.5, .cy = 31.5};
    in.distortion = {-0.15, 0.03, 0.001, -0.001, 0};
    const DrawnRobot drawn =
        Drawn(robot, {PartDrawer({in, CameraAbout(random).camera_from_world()}, {64, 64})});
    for (int i = 0; i < 3; ++i) Compare(random, robot, drawn, 20000, tally);
  }
  EXPECT_EQ(tally.missing, 0u);
  RecordProperty("drawn_for_1000_touched", static_cast<int>(1000 * tally.drawn / tally.touched));
  EXPECT_LT(static_cast<double>(tally.drawn), 1.12 * static_cast<double>(tally.touched));
}

// Whether a ray meets the solid of a primitive shape that is shrunk by `less`.
bool Meets(const Shape& shape, double less, const Vector3d& from, const Vector3d& along) {
  double first = 0;
  double last = 1e9;
  const auto between = [&](double at, double speed, double half) {
    if (std::abs(speed) < 1e-15) {
      if (std::abs(at) > half) last = -1;
      return;
    }
    const double a = (-half - at) / speed;
    const double b = (half - at) / speed;
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  };
  if (const auto* box = std::get_if<BoxShape>(&shape)) {
    for (int axis = 0; axis < 3; ++axis) {
      between(from[axis], along[axis], box->size[axis] / 2 - less);
    }
    return first <= last;
  }
  const auto* cylinder = std::get_if<CylinderShape>(&shape);
  if (cylinder == nullptr) return false;
  between(from.z(), along.z(), cylinder->length / 2 - less);
  const double a = along.head<2>().squaredNorm();
  const double b = from.head<2>().dot(along.head<2>());
  const double radius = cylinder->radius - less;
  const double root = b * b - a * (from.head<2>().squaredNorm() - radius * radius);
  if (root < 0) return false;
  first = std::max(first, (-b - std::sqrt(root)) / a);
  last = std::min(last, (-b + std::sqrt(root)) / a);
  return first <= last;
}

TEST(DrawnRobot, EveryRayOfACoveredPixelMeetsTheShrunkRobot) {
  Random random;
  const RobotModel robot = Rx130();
  size_t looks = 0;
  size_t wrong = 0;
  size_t covered = 0;
  size_t touched = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const DrawnRobot drawn =
        Drawn(robot, {PartDrawer(CameraAbout(random), {trial % 2 == 0 ? 96 : 320, 96})});
    const CameraModel& camera = drawn.views()[0].camera();
    const std::vector<double> q = RandomPositions(random, robot);
    const std::vector<Isometry3d> poses = robot.LinkPoses(q);
    const Mask mask = drawn.Covered(q)[0];
    for (int y = 0; y < mask.height(); ++y) {
      for (int x = 0; x < mask.width(); ++x) {
        if (!mask.at(x, y)) continue;
        for (int i = 0; i < 6; ++i) {
          const Vector2d in_pixel(Uniform(random, -0.5, 0.5), Uniform(random, -0.5, 0.5));
          const auto ray = camera.Ray(Vector2d(x, y) + in_pixel);
          bool meets = false;
          for (size_t link = 0; ray && link < poses.size() && !meets; ++link) {
            for (const LinkGeometry& geometry : robot.links()[link].body()) {
              const Isometry3d shape_from_base = (poses[link] * geometry.link_from_shape).inverse();
              meets = meets || Meets(geometry.shape, kTolerance, shape_from_base * camera.Centre(),
                                     shape_from_base.linear() * *ray);
            }
          }
          ++looks;
          if (!meets) ++wrong;
        }
      }
    }
    covered += mask.Count();
    touched += drawn.Touched(q)[0].Count();
  }
  EXPECT_GT(4 * covered, touched) << "it is not little";
  EXPECT_EQ(wrong, 0u);
  EXPECT_GT(looks, 2000u);
}

TEST(DrawnRobot, RoundPartsThatMoveWithTheLinkBeforeAreWhereTheyWere) {
  Random random;
  const RobotModel robot = Rx130();
  PartSettings settings;
  std::vector<RobotPart> parts = RobotParts::Of(robot, settings).value().parts();
  const PartDrawer view(CameraAbout(random), {128, 128});
  for (int trial = 0; trial < 20; ++trial) {
    const std::vector<Isometry3d> poses = robot.LinkPoses(RandomPositions(random, robot));
    for (const RobotPart& part : parts) {
      // Its middle is the same seen from the link that it is of, wherever that stands.
      const std::vector<Isometry3d> at_zero =
          robot.LinkPoses(std::vector<double>(robot.joints().size(), 0));
      const Vector3d middle = part.points.rowwise().mean();
      const Vector3d in_link = at_zero[part.link].inverse() * (at_zero[part.moves_with] * middle);
      EXPECT_LT((poses[part.link] * in_link - poses[part.moves_with] * middle).norm(), 1e-6);
    }
  }
}

TEST(DrawnRobot, PartsThatCannotBeAreRefused) {
  const RobotModel robot = Rx130();
  const KinematicChain chain = ChainOf(robot);
  EXPECT_THROW(DrawnRobot(chain, {}, {}), std::invalid_argument);
  EXPECT_THROW(DrawnRobot(chain, {RobotPart{}}, {}), std::invalid_argument);
  RobotPart of_no_link{.moves_with = 99, .points = Eigen::Matrix3Xd::Zero(3, 1), .inner = {}};
  EXPECT_THROW(DrawnRobot(chain, {of_no_link}, {}), std::invalid_argument);
  Random random;
  const DrawnRobot drawn = Drawn(robot, {PartDrawer(CameraAbout(random), {64, 64})});
  EXPECT_THROW(drawn.Touched(std::vector<double>(3)), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
