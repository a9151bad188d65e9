// SPDX-License-Identifier: Apache-2.0
// Drawn bodies: no pixel of the grown body is missing, and none is called covered that is not.
#include "calib/robot/drawing/part_drawer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <vector>

#include "calib/robot/drawing/convex_outline.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;

TriangleMesh RandomBody(Random& random) {
  const auto size = [&] { return std::pow(10, Uniform(random, -2, 0)); };
  switch (random() % 3) {
    case 0:
      return BoxMesh({size(), size(), size()});
    case 1:
      return CylinderMesh(size() / 2, size());
    default:
      return SphereMesh(size() / 2);
  }
}

Mask Touched(const PartDrawer& drawer, const Isometry3d& pose, const Matrix3Xd& points,
             double growth) {
  DrawingScratch scratch;
  std::vector<uint64_t> words(drawer.size().words());
  drawer.AddTouched(pose, points, HullEdges(points), growth, scratch, words);
  return Mask::FromWords(drawer.size(), words);
}

Mask Covered(const PartDrawer& drawer, const Isometry3d& pose, const Matrix3Xd& points) {
  DrawingScratch scratch;
  std::vector<uint64_t> words(drawer.size().words());
  drawer.AddCovered(pose, points, scratch, words);
  return Mask::FromWords(drawer.size(), words);
}

// Half of them as large as can be.
Vector2d RandomError(Random& random, double margin) {
  Vector2d error(Uniform(random, -margin, margin), Uniform(random, -margin, margin));
  if (random() % 2 == 0) error = margin * error.cwiseSign();
  return error;
}

// The pixel that shows a point, `off` from where the model has it; nothing if the image does not.
std::optional<Eigen::Vector2i> PixelOf(const CameraModel& camera, const Vector3d& point,
                                       const Vector2d& off = Vector2d::Zero()) {
  auto at = camera.Project(point);
  if (at) *at += off;
  if (!at || !camera.Contains(*at)) return std::nullopt;
  const Vector2d limit(camera.intrinsics().width - 1, camera.intrinsics().height - 1);
  return (*at + Vector2d(0.5, 0.5)).array().floor().matrix().cwiseMin(limit).cast<int>();
}

bool RayMeets(const TriangleMesh& mesh, const Vector3d& from, const Vector3d& along) {
  for (const auto& [a, b, c] : mesh.triangles) {
    Eigen::Matrix3d sides;
    sides << mesh.vertices[b] - mesh.vertices[a], mesh.vertices[c] - mesh.vertices[a], -along;
    if (std::abs(sides.determinant()) < 1e-15) continue;
    const Vector3d at = sides.inverse() * (from - mesh.vertices[a]);
    constexpr double kOn = -1e-9;
    if (at.x() >= kOn && at.y() >= kOn && at.x() + at.y() <= 1 - kOn && at.z() > 0) return true;
  }
  return false;
}

TEST(PartDrawer, NoPixelOfTheGrownBodyIsMissing) {
  Random random;
  size_t seen = 0;
  size_t drawn = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const TriangleMesh mesh = RandomBody(random);
    const CameraModel camera = RandomCamera(random, Isometry3d::Identity());
    const PartDrawer drawer(camera, RandomMaskSize(random));
    // Also beside the camera, behind it, and about it.
    const Isometry3d pose = RandomPose(
        random, {Uniform(random, -2, 2), Uniform(random, -2, 2), Uniform(random, -0.5, 4)});
    const double growth = trial % 4 == 0 ? 0 : std::pow(10, Uniform(random, -3, -1));
    const Mask mask = Touched(drawer, pose, PointsOf(mesh), growth);
    drawn += mask.Count();
    for (int i = 0; i < SampleCount(8000); ++i) {
      const Vector3d point = pose * SurfacePoint(random, mesh) + growth * RandomDirection(random);
      const auto pixel = PixelOf(drawer.camera(), point);
      if (!pixel) continue;
      ++seen;
      ASSERT_TRUE(mask.at(pixel->x(), pixel->y()))
          << "trial " << trial << ", pixel " << pixel->transpose() << ", growth " << growth
          << ", point " << point.transpose();
    }
  }
  EXPECT_GT(seen, static_cast<size_t>(SampleCount(80000)));
  EXPECT_GT(drawn, 4000u);
}

TEST(PartDrawer, BodyWhosePointsAreAllOneIsDrawn) {
  Random random;
  const PartDrawer drawer(RandomCamera(random, Isometry3d::Identity()), MaskSize{64, 64});
  const Isometry3d pose(Eigen::Translation3d(0, 0, 2));
  const auto pixel = PixelOf(drawer.camera(), {0, 0, 2});
  ASSERT_TRUE(pixel.has_value());
  for (const double growth : {0.0, 1e-4, 0.1}) {
    EXPECT_TRUE(Touched(drawer, pose, Matrix3Xd::Zero(3, 9), growth).at(pixel->x(), pixel->y()))
        << growth;
  }
}

TEST(PartDrawer, CameraThatIsOffByUpToTheMarginShowsNoOtherPixel) {
  Random random;
  size_t seen = 0;
  size_t beyond = 0;  // what is drawn without the margin
  for (int trial = 0; trial < 40; ++trial) {
    const TriangleMesh mesh = RandomBody(random);
    const CameraModel camera = RandomCamera(random, Isometry3d::Identity());
    const MaskSize size = RandomMaskSize(random);
    const double margin = Uniform(random, 0, trial % 3 == 0 ? 4 : 0.5);
    const PartDrawer drawer(camera, size, margin);
    const Isometry3d pose = RandomPose(
        random, {Uniform(random, -2, 2), Uniform(random, -2, 2), Uniform(random, -0.5, 4)});
    const double growth = trial % 4 == 0 ? 0 : std::pow(10, Uniform(random, -3, -1));
    const Mask mask = Touched(drawer, pose, PointsOf(mesh), growth);
    const Mask without = Touched(PartDrawer(camera, size), pose, PointsOf(mesh), growth);
    EXPECT_TRUE((without - mask).Empty());
    for (int i = 0; i < SampleCount(8000); ++i) {
      const Vector3d point = pose * SurfacePoint(random, mesh) + growth * RandomDirection(random);
      const auto pixel = PixelOf(drawer.camera(), point, RandomError(random, margin));
      if (!pixel) continue;
      ++seen;
      beyond += without.at(pixel->x(), pixel->y()) ? 0 : 1;
      ASSERT_TRUE(mask.at(pixel->x(), pixel->y()))
          << "trial " << trial << ", pixel " << pixel->transpose() << ", growth " << growth
          << ", margin " << margin << ", point " << point.transpose();
    }
  }
  EXPECT_GT(seen, static_cast<size_t>(SampleCount(50000)));
  EXPECT_GT(beyond, static_cast<size_t>(SampleCount(500)));
}

TEST(PartDrawer, OutlineIsWidenedByNoMoreThanTheMargin) {
  const CameraModel camera({.width = 64, .height = 64, .fx = 50, .fy = 50, .cx = 31.5, .cy = 31.5});
  const Isometry3d pose(Eigen::Translation3d(0, 0, 1));
  const Matrix3Xd points = PointsOf(BoxMesh({0.2, 0.2, 0.002}));
  // A square of 10 pixels about the middle of the image, which is at a pixel's corner.
  const size_t without = Touched(PartDrawer(camera, {64, 64}), pose, points, 0).Count();
  EXPECT_EQ(without, 12u * 12);
  EXPECT_EQ(Touched(PartDrawer(camera, {64, 64}, 0.5), pose, points, 0).Count(), 12u * 12);
  EXPECT_EQ(Touched(PartDrawer(camera, {64, 64}, 2.5), pose, points, 0).Count(), 16u * 16);
  EXPECT_EQ(Covered(PartDrawer(camera, {64, 64}, 0.5), pose, points).Count(), 8u * 8);
  EXPECT_EQ(Covered(PartDrawer(camera, {64, 64}, 2.5), pose, points).Count(), 4u * 4);
}

TEST(PartDrawer, LongEdgesBendAsTheLensDoes) {
  Random random;
  const CameraModel camera({.width = 320,
                            .height = 240,
                            .fx = 180,
                            .fy = 180,
                            .cx = 159.5,
                            .cy = 119.5,
                            .distortion = {-0.25, 0.06, 0, 0, 0}});
  const PartDrawer drawer(camera, {320, 240});
  const TriangleMesh bar = BoxMesh({0.01, 3, 0.01});
  for (int trial = 0; trial < 40; ++trial) {
    const Isometry3d pose =
        Eigen::Translation3d(Uniform(random, -1.2, 1.2), 0, Uniform(random, 1.4, 2)) *
        Eigen::AngleAxisd(Uniform(random, -0.3, 0.3), Vector3d::UnitZ());
    const Mask mask = Touched(drawer, pose, PointsOf(bar), 0);
    for (int i = 0; i < SampleCount(2000); ++i) {
      const Vector3d point = pose * SurfacePoint(random, bar);
      const auto pixel = PixelOf(camera, point);
      ASSERT_TRUE(!pixel || mask.at(pixel->x(), pixel->y())) << "trial " << trial;
    }
    EXPECT_LT(mask.Count(), 2500u);
  }
}

TEST(PartDrawer, LittleMoreIsTouchedThanTheBody) {
  Random random;
  size_t drawn = 0;
  size_t sampled = 0;
  for (int trial = 0; trial < SampleCount(25); ++trial) {
    const TriangleMesh mesh = CylinderMesh(Uniform(random, 0.05, 0.2), Uniform(random, 0.2, 0.8));
    const CameraModel camera = RandomCamera(random, Isometry3d::Identity());
    const PartDrawer drawer(camera, {64, 64});
    const Isometry3d pose = RandomPose(random, {0, 0, Uniform(random, 2, 3)});
    const double growth = Uniform(random, 0, 0.03);
    const Mask mask = Touched(drawer, pose, PointsOf(mesh), growth);
    std::vector<uint64_t> words(mask.size().words());
    for (int i = 0; i < 100000; ++i) {
      const Vector3d point = pose * SurfacePoint(random, mesh) + growth * RandomDirection(random);
      const auto pixel = PixelOf(drawer.camera(), point);
      if (!pixel) continue;
      const auto bit = static_cast<size_t>(pixel->y() * 64 + pixel->x());
      words[bit / 64] |= uint64_t{1} << (bit % 64);
    }
    // What the surface encloses in a row is the body's too: it is convex, and so nearly are rows.
    for (uint64_t& row : words) {
      if (row == 0) continue;
      row = (~uint64_t{0} << std::countr_zero(row)) & (~uint64_t{0} >> std::countl_zero(row));
    }
    const Mask truth = Mask::FromWords(mask.size(), words);
    drawn += mask.Count();
    sampled += truth.Count();
  }
  RecordProperty("drawn_for_100_touched", static_cast<int>(100 * drawn / sampled));
  EXPECT_LT(static_cast<double>(drawn), 1.1 * static_cast<double>(sampled));
  EXPECT_GT(sampled, static_cast<size_t>(SampleCount(1000)));
}

TEST(PartDrawer, EveryRayOfACoveredPixelMeetsTheBodyThoughTheCameraIsOff) {
  Random random;
  size_t covered = 0;
  size_t touched = 0;
  for (int trial = 0; trial < 80; ++trial) {
    const TriangleMesh mesh = RandomBody(random);
    const CameraModel camera = RandomCamera(random, Isometry3d::Identity());
    const double margin = trial % 3 == 0 ? 0 : Uniform(random, 0, trial % 3 == 1 ? 0.5 : 2);
    const PartDrawer drawer(camera, trial % 2 == 0 ? MaskSize{64, 64} : MaskSize{96, 72}, margin);
    const Isometry3d pose =
        RandomPose(random, {Uniform(random, -1, 1), Uniform(random, -1, 1), Uniform(random, 0, 3)});
    const Mask mask = Covered(drawer, pose, PointsOf(mesh));
    covered += mask.Count();
    touched += Touched(drawer, pose, PointsOf(mesh), 0).Count();
    const Isometry3d body_from_world = pose.inverse();
    int looks = 0;
    for (int i = 0; i < 20000 && looks < 300; ++i) {
      const int x = static_cast<int>(random() % static_cast<size_t>(mask.width()));
      const int y = static_cast<int>(random() % static_cast<size_t>(mask.height()));
      if (!mask.at(x, y)) continue;
      ++looks;
      // On its rim as often as within.
      Vector2d in_pixel(Uniform(random, -0.5, 0.5), Uniform(random, -0.5, 0.5));
      if (i % 2 == 0) in_pixel.x() = i % 4 == 0 ? -0.5 : 0.5;
      const auto ray = drawer.camera().Ray(Vector2d(x, y) + in_pixel + RandomError(random, margin));
      ASSERT_TRUE(ray) << "trial " << trial;
      ASSERT_TRUE(RayMeets(mesh, body_from_world.translation(), body_from_world.linear() * *ray))
          << "trial " << trial << ", pixel " << x << ' ' << y;
    }
  }
  EXPECT_GT(covered, 3000u);
  EXPECT_GT(2 * covered, touched);
}

// Meets looks at an octagon first.
TEST(PartDrawer, BodyMeetsEveryPixelOfItsRimAndNoneBesideIt) {
  Random random;
  size_t rim = 0;
  size_t beside = 0;
  for (int trial = 0; trial < SampleCount(150); ++trial) {
    const TriangleMesh mesh = RandomBody(random);
    const CameraModel camera = RandomCamera(random, Isometry3d::Identity());
    const PartDrawer drawer(camera, {64, 48}, trial % 3 == 0 ? Uniform(random, 0, 2) : 0);
    const Isometry3d pose = RandomPose(
        random, {Uniform(random, -1, 1), Uniform(random, -1, 1), Uniform(random, 0.2, 4)});
    const double growth = trial % 4 == 0 ? 0 : std::pow(10, Uniform(random, -3.5, -0.5));
    const Mask mask = Touched(drawer, pose, PointsOf(mesh), growth);
    const HullEdges edges(PointsOf(mesh));
    DrawingScratch scratch;
    for (int y = 0; y < mask.height(); ++y) {
      for (int x = 0; x < mask.width(); ++x) {
        const bool set = mask.at(x, y);
        bool at_rim = false;
        for (int i = 0; i < 9; ++i) {
          const int u = std::clamp(x + i % 3 - 1, 0, mask.width() - 1);
          const int v = std::clamp(y + i / 3 - 1, 0, mask.height() - 1);
          at_rim = at_rim || mask.at(u, v) != set;
        }
        if (!at_rim) continue;
        const DrawnPlane pixel(
            Mask::FromPredicate(mask.size(), [&](int u, int v) { return u == x && v == y; }));
        ASSERT_EQ(drawer.Meets(pose, PointsOf(mesh), edges, growth, scratch, pixel), set)
            << "trial " << trial << ", pixel " << x << ' ' << y;
        ++(set ? rim : beside);
      }
    }
  }
  EXPECT_GT(rim, static_cast<size_t>(SampleCount(1500)));
  EXPECT_GT(beside, static_cast<size_t>(SampleCount(1500)));
}

TEST(PartDrawer, MaskOfABodyWithKnownEdgesIsThatOfAllItsPoints) {
  Random random;
  size_t both = 0;
  size_t differ = 0;
  for (int trial = 0; trial < SampleCount(400); ++trial) {
    const TriangleMesh mesh = RandomBody(random);
    const PartDrawer drawer(RandomCamera(random, Isometry3d::Identity()), {64, 48});
    const Isometry3d pose =
        RandomPose(random, {Uniform(random, -1, 1), Uniform(random, -1, 1), Uniform(random, 1, 4)});
    const double growth = trial % 2 == 0 ? 0 : std::pow(10, Uniform(random, -4, -2.5));
    DrawingScratch scratch;
    std::vector<uint64_t> words(drawer.size().words());
    drawer.AddTouched(pose, PointsOf(mesh), {}, growth, scratch, words);
    const Mask all = Mask::FromWords(drawer.size(), words);
    const Mask by_edges = Touched(drawer, pose, PointsOf(mesh), growth);
    both += (all & by_edges).Count();
    differ += (all & ~by_edges).Count() + (by_edges & ~all).Count();
  }
  EXPECT_GT(both, static_cast<size_t>(SampleCount(4000)));
  EXPECT_LE(differ, both / 10000);  // at the limit of a pixel, by rounding
}

TEST(PartDrawer, EdgesOfAnotherBodyAreNotUsed) {
  const CameraModel camera({.width = 64, .height = 64, .fx = 50, .fy = 50, .cx = 31.5, .cy = 31.5});
  const PartDrawer drawer(camera, {64, 64});
  const Isometry3d pose(Eigen::Translation3d(0, 0, 1));
  const Matrix3Xd points = PointsOf(BoxMesh({0.2, 0.2, 0.2}));
  DrawingScratch scratch;
  std::vector<uint64_t> words(drawer.size().words());
  drawer.AddTouched(pose, points, HullEdges(PointsOf(CylinderMesh(0.1, 0.1))), 0, scratch, words);
  EXPECT_EQ(Mask::FromWords(drawer.size(), words), Touched(drawer, pose, points, 0));
}

TEST(PartDrawer, BodyBehindTheCameraIsNotSeen) {
  const CameraModel camera({.width = 64, .height = 64, .fx = 50, .fy = 50, .cx = 31.5, .cy = 31.5});
  const PartDrawer drawer(camera, {64, 64});
  const Matrix3Xd points = PointsOf(BoxMesh({0.2, 0.2, 0.2}));
  EXPECT_TRUE(Touched(drawer, Isometry3d(Eigen::Translation3d(0, 0, -1)), points, 0.1).Empty());
  EXPECT_TRUE(Touched(drawer, Isometry3d(Eigen::Translation3d(3, 0, 0.5)), points, 0.1).Empty());
}

TEST(PartDrawer, CameraInTheBodySeesNothingElse) {
  const CameraModel camera({.width = 64, .height = 64, .fx = 50, .fy = 50, .cx = 31.5, .cy = 31.5});
  const PartDrawer drawer(camera, {64, 64});
  const Matrix3Xd points = PointsOf(BoxMesh({0.2, 0.2, 0.2}));
  const Isometry3d here = Isometry3d::Identity();
  EXPECT_EQ(Touched(drawer, here, points, 0).Count(), 64u * 64);
  EXPECT_TRUE(Covered(drawer, here, points).Empty());
  // It passes the camera at the side: what is before it is drawn, not all.
  const Isometry3d beside(Eigen::Translation3d(0.8, 0, 0));
  const Mask mask = Touched(drawer, beside, PointsOf(BoxMesh({0.2, 0.2, 4})), 0.01);
  EXPECT_GT(mask.Count(), 50u);
  EXPECT_LT(mask.Count(), 1000u);
}

TEST(PartDrawer, NumbersThatCannotBeAreRefused) {
  const CameraModel camera({.width = 64, .height = 64, .fx = 50, .fy = 50, .cx = 31.5, .cy = 31.5});
  EXPECT_THROW(PartDrawer(camera, {0, 64}), std::invalid_argument);
  EXPECT_THROW(PartDrawer(camera, {64, 64}, -0.1), std::invalid_argument);
  EXPECT_THROW(PartDrawer(camera, {64, 64}, std::nan("")), std::invalid_argument);
  const PartDrawer drawer(camera, {64, 64});
  const Isometry3d pose(Eigen::Translation3d(0, 0, 1));
  const Matrix3Xd points = PointsOf(BoxMesh({0.2, 0.2, 0.2}));
  EXPECT_THROW(Touched(drawer, pose, points, -0.1), std::invalid_argument);
  EXPECT_THROW(Touched(drawer, pose, Matrix3Xd(3, 0), 0), std::invalid_argument);
  // A vertex that is no number may be anywhere.
  Matrix3Xd bad = points;
  bad(1, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(Touched(drawer, pose, bad, 0).Count(), 64u * 64);
  EXPECT_TRUE(Covered(drawer, pose, bad).Empty());
}

TEST(ConvexOutline, HoldsAllThatIsNear) {
  Random random;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<Vector2d> points;
    const size_t count = 1 + random() % 12;
    for (size_t i = 0; i < count; ++i) {
      points.emplace_back(Uniform(random, -1, 1), trial % 5 == 0 ? 0.5 : Uniform(random, -1, 1));
    }
    const std::vector<Vector2d> given = points;
    std::vector<Vector2d> hull;
    std::vector<Vector2d> outline;
    ConvexHull(points, hull);
    const double radius = Uniform(random, 0.01, 1);
    WidenOutline(hull, radius, outline);
    for (int i = 0; i < SampleCount(500); ++i) {
      const double angle = Uniform(random, 0, 2 * std::numbers::pi);
      const Vector2d p =
          given[random() % count] + radius * Vector2d(std::cos(angle), std::sin(angle));
      for (size_t k = 0; k < outline.size(); ++k) {
        const Vector2d edge = outline[(k + 1) % outline.size()] - outline[k];
        const Vector2d to = p - outline[k];
        ASSERT_GE(edge.x() * to.y() - edge.y() * to.x(), -1e-9) << "trial " << trial;
      }
    }
    for (const Vector2d& corner : outline) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const Vector2d& p : hull) nearest = std::min(nearest, (corner - p).norm());
      ASSERT_LE(nearest, 1.036 * radius);
    }
  }
}

}  // namespace
}  // namespace silhouette
