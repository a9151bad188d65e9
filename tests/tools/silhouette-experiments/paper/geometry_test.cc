// SPDX-License-Identifier: Apache-2.0
// Arm, cameras, rasters and the ideal test of the paper's simulation.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "common/yaml/strict_yaml.h"
#include "server/collision/epipolar_bands.h"
#include "tests/random.h"
#include "tests/tools/silhouette-experiments/paper/small_settings.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"

namespace silhouette::paper {
namespace {

using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

class Geometry : public testing::Test {
 protected:
  double Uniform(double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random_);
  }
  Vector3d PointIn(const Sphere& sphere) {
    for (;;) {
      const Vector3d p(Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1));
      if (p.squaredNorm() < 1) return sphere.centre + sphere.radius * p;
    }
  }
  Sphere RandomSphere() {
    return {{Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1)}, Uniform(0.01, 0.3)};
  }

  Random random_;
};

TEST_F(Geometry, TheArmStretchesFromTheOriginAlongX) {
  const Spheres arm = ArmAt({}, Variant::kPlanar, 0, 0);
  ASSERT_EQ(arm.size(), 10u);
  EXPECT_EQ(arm.front().centre, Vector3d(0, 0, 0));
  EXPECT_LT((arm[1].centre - Vector3d(0.1125, 0, 0)).norm(), 1e-12);
  EXPECT_LT((arm.back().centre - Vector3d(0.9, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(arm.back().radius, 0.07);
}

TEST_F(Geometry, ThePlanarArmStaysInItsPlaneAndTheSpatialArmsFirstLinkStaysLevel) {
  for (int i = 0; i < 50; ++i) {
    const double q1 = Uniform(0, 2 * kPi);
    const double q2 = Uniform(0, 2 * kPi);
    for (const Sphere& sphere : ArmAt({}, Variant::kPlanar, q1, q2)) {
      EXPECT_EQ(sphere.centre.y(), 0);
    }
    const Spheres arm = ArmAt({}, Variant::kSpatial, q1, q2);
    EXPECT_LT((arm[4].centre - 0.45 * Vector3d(std::cos(q1), std::sin(q1), 0)).norm(), 1e-12);
    EXPECT_NEAR(arm[9].centre.z(), 0.45 * std::sin(q2), 1e-12);
    EXPECT_NEAR((arm[9].centre - arm[5].centre).norm(), 0.45, 1e-12);
  }
}

TEST_F(Geometry, SpheresTouchIfAPointIsInBoth) {
  int touching = 0;
  for (int i = 0; i < 500; ++i) {
    const Sphere a = RandomSphere();
    const Sphere b = RandomSphere();
    const bool touch = Touch(Spheres{a}, Spheres{b});
    touching += touch;
    for (int k = 0; k < 50; ++k) {
      const Vector3d p = PointIn(a);
      if ((p - b.centre).norm() < b.radius) {
        EXPECT_TRUE(touch);
      }
    }
    if (!touch) continue;
    // The point of `a` nearest to the middle of `b` is in `b`.
    const Vector3d way = b.centre - a.centre;
    const Vector3d nearest = a.centre + way.normalized() * std::min(a.radius, way.norm());
    EXPECT_LE((nearest - b.centre).norm(), b.radius + 1e-12);
  }
  EXPECT_GT(touching, 0);
}

TEST_F(Geometry, ATouchedPixelIsOneThatSomePointOfASphereIsSeenIn) {
  const Settings settings = SmallSettings(32);
  for (const auto& [name, rig] : settings.rigs) {
    for (const ParallelCamera& camera : rig) {
      const Sphere sphere = RandomSphere();
      const Mask image = ImageOf(camera, Spheres{sphere}, Raster::kTouch);
      for (int k = 0; k < 2000; ++k) {
        const Eigen::Vector2d at = camera.Project(PointIn(sphere));
        const auto x = static_cast<int>(std::lround(at.x()));
        const auto y = static_cast<int>(std::lround(at.y()));
        if (x < 0 || y < 0 || x >= image.width() || y >= image.height()) continue;
        EXPECT_TRUE(image.at(x, y)) << "rig " << name;
      }
      // And no others: the nearest point of the square is within the disc.
      const Eigen::Vector2d centre = camera.Project(sphere.centre);
      const double radius = sphere.radius * camera.pixels_per_unit();
      for (int y = 0; y < image.height(); ++y) {
        for (int x = 0; x < image.width(); ++x) {
          const Eigen::Vector2d nearest(std::clamp(centre.x(), x - 0.5, x + 0.5),
                                        std::clamp(centre.y(), y - 0.5, y + 0.5));
          EXPECT_EQ(image.at(x, y), (nearest - centre).norm() <= radius);
        }
      }
    }
  }
}

TEST_F(Geometry, APixelsCentreIsCoveredIfItsRayMeetsTheSphere) {
  const Settings settings = SmallSettings(32);
  for (const auto& [name, rig] : settings.rigs) {
    for (const ParallelCamera& camera : rig) {
      const Sphere sphere = RandomSphere();
      const Mask image = ImageOf(camera, Spheres{sphere}, Raster::kCentre);
      for (int y = 0; y < image.height(); ++y) {
        for (int x = 0; x < image.width(); ++x) {
          const Vector3d on_ray =
              ((x + 0.5) / 16 - 1) * camera.right() + (1 - (y + 0.5) / 16) * camera.up();
          const double distance = (sphere.centre - on_ray).cross(camera.direction()).norm();
          EXPECT_EQ(image.at(x, y), distance <= sphere.radius) << "rig " << name;
        }
      }
    }
  }
}

TEST_F(Geometry, ImagesOfOnePointObeyTheFundamentalMatricesAndTheBands) {
  const Settings settings = SmallSettings(32);
  for (const auto& [name, rig] : settings.rigs) {
    const Calibration calibration = CalibrationOf(rig);
    EXPECT_EQ(calibration.fundamental_matrices.size(), rig.size() * (rig.size() - 1) / 2);
    const EpipolarBands bands(calibration, std::vector<MaskSize>(rig.size(), {32, 32}));
    for (int k = 0; k < 200; ++k) {
      const Vector3d p(Uniform(-0.57, 0.57), Uniform(-0.57, 0.57), Uniform(-0.57, 0.57));
      for (const FundamentalMatrix& pair : calibration.fundamental_matrices) {
        const Eigen::Vector2d a = rig[static_cast<size_t>(pair.view_a)].Project(p);
        const Eigen::Vector2d b = rig[static_cast<size_t>(pair.view_b)].Project(p);
        EXPECT_NEAR(b.homogeneous().dot(pair.f * a.homogeneous()), 0, 1e-12);
        const auto pixel = [](const Eigen::Vector2d& at) {
          return static_cast<int>(std::lround(at.y()) * 32 + std::lround(at.x()));
        };
        EXPECT_TRUE(bands.Meet(pair.view_a, pixel(a), pair.view_b, pixel(b)));
      }
    }
  }
}

TEST_F(Geometry, CamerasAlongOneLineAreRefused) {
  const std::vector<ParallelCamera> rig = {ParallelCamera({0, 0, 1}, 1, 8),
                                           ParallelCamera({0, 0, -2}, 1, 8)};
  EXPECT_THROW(CalibrationOf(rig), std::invalid_argument);
  EXPECT_THROW(ParallelCamera({0, 0, 0}, 1, 8), std::invalid_argument);
}

TEST_F(Geometry, TheSetsOfTouchingConfigurationsAreThoseOfTheArms) {
  const Settings settings = SmallSettings();
  for (const Variant variant : {Variant::kPlanar, Variant::kSpatial}) {
    const ArmTable arms(settings, variant);
    const SphereScene scene = RandomScene(settings, arms, 0);
    const ConfigurationSet on = arms.Touching(scene.obstacles);
    const ConfigurationSet off = arms.TouchingOffGrid(scene.obstacles, scene.offsets);
    const double step = 2 * kPi / settings.steps;
    for (int a = 0; a < settings.steps; ++a) {
      for (int b = 0; b < settings.steps; ++b) {
        const auto i = static_cast<size_t>(a * settings.steps + b);
        EXPECT_EQ(Contains(on, i),
                  Touch(ArmAt(settings.arm, variant, a * step, b * step), scene.obstacles));
        const auto [da, db] = scene.offsets[i];
        EXPECT_EQ(
            Contains(off, i),
            Touch(ArmAt(settings.arm, variant, (a + da) * step, (b + db) * step), scene.obstacles));
        EXPECT_EQ(arms.CellOf(arms.JointsIn(i, {0.5, 0.5})), i);
      }
    }
  }
}

TEST_F(Geometry, RandomScenesComeAgainAndLeaveTheRobotFree) {
  const Settings settings = SmallSettings();
  const ArmTable arms(settings, Variant::kSpatial);
  for (int number = 0; number < 20; ++number) {
    const SphereScene scene = RandomScene(settings, arms, number);
    EXPECT_FALSE(Touch(arms.At(scene.current), scene.obstacles));
    EXPECT_FALSE(Touch(arms.AtJoints(scene.current_off_grid), scene.obstacles));
    EXPECT_GE(scene.obstacles.size(), 1u);
    EXPECT_LE(scene.obstacles.size(), 5u);
    for (const Sphere& sphere : scene.obstacles) {
      EXPECT_GE(sphere.radius, 0.06);
      EXPECT_LE(sphere.radius, 0.20);
    }
    const SphereScene again = RandomScene(settings, arms, number);
    EXPECT_EQ(again.obstacles[0].centre, scene.obstacles[0].centre);
    EXPECT_EQ(again.current, scene.current);
  }
}

TEST_F(Geometry, ObstaclesThatAlwaysBlockTheRobotAreAMistake) {
  Settings settings = SmallSettings();
  settings.random.radius = {2, 2};
  const ArmTable arms(settings, Variant::kPlanar);
  EXPECT_THROW(RandomScene(settings, arms, 0), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette::paper
