// SPDX-License-Identifier: Apache-2.0
// Links as convex parts: nothing of the robot is lost, and what is called certain is.
#include "calib/robot/parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "calib/robot/convex_hull.h"
#include "calib/robot/distance_field.h"
#include "calib/robot/mesh_parts.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/folders.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using testing::AllOf;
using testing::HasSubstr;

// A ring about z.
TriangleMesh TorusMesh(double radius, double thickness) {
  constexpr uint32_t kRound = 32;
  constexpr uint32_t kTube = 12;
  TriangleMesh mesh;
  for (uint32_t i = 0; i < kRound * kTube; ++i) {
    const double a = 2 * std::numbers::pi * (i / kTube) / kRound;
    const double b = 2 * std::numbers::pi * (i % kTube) / kTube;
    const double away = radius + thickness * std::cos(b);
    mesh.vertices.emplace_back(away * std::cos(a), away * std::sin(a), thickness * std::sin(b));
  }
  for (uint32_t i = 0; i < kRound; ++i) {
    for (uint32_t k = 0; k < kTube; ++k) {
      const auto at = [&](uint32_t x, uint32_t y) { return x % kRound * kTube + y % kTube; };
      mesh.triangles.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
      mesh.triangles.push_back({at(i, k), at(i + 1, k + 1), at(i, k + 1)});
    }
  }
  return mesh;
}

// A link with one mesh, as a robot.
RobotModel WithOneMesh(TriangleMesh mesh) {
  const std::string urdf = "<robot name='r'><link name='hand'/></robot>";
  const auto robot = RobotModel::FromUrdf(WriteFile(FreshFolder() / "r.urdf", urdf)).value();
  const MeshShape shape{"hand.stl", std::make_shared<const TriangleMesh>(std::move(mesh))};
  return robot.WithBody(0, {.shape = shape, .colour = {}});
}

absl::StatusOr<RobotParts> PartsOfMesh(TriangleMesh mesh, const PartSettings& settings = {}) {
  return RobotParts::Of(WithOneMesh(std::move(mesh)), settings);
}

std::vector<Vector3d> VectorOf(const Matrix3Xd& columns) {
  std::vector<Vector3d> points;
  for (Eigen::Index i = 0; i < columns.cols(); ++i) points.emplace_back(columns.col(i));
  return points;
}

TEST(ConvexHull, HoldsItsPointsAndShrinks) {
  Random random;
  std::vector<Vector3d> points;
  for (int i = 0; i < 300; ++i) points.push_back(Uniform(random, 0.1, 1) * RandomDirection(random));
  const auto hull = HullOf(points);
  ASSERT_TRUE(hull);
  for (const Vector3d& point : points) EXPECT_GE(hull->Depth(point), -1e-9);
  EXPECT_LT(hull->vertices.size(), points.size());
  EXPECT_TRUE(IsClosed({hull->vertices, hull->triangles}));
  for (size_t i = 0; i < hull->planes.size(); ++i) {
    const auto& [a, b, c] = hull->triangles[i];
    const Vector3d normal = (hull->vertices[b] - hull->vertices[a])
                                .cross(hull->vertices[c] - hull->vertices[a])
                                .normalized();
    EXPECT_GT(normal.dot(hull->planes[i].normal), 0.99);
  }
  const auto shrunk = Shrunk(*hull, 0.1);
  ASSERT_TRUE(shrunk);
  double least = 1;
  for (const Vector3d& corner : shrunk->vertices) least = std::min(least, hull->Depth(corner));
  EXPECT_NEAR(least, 0.1, 1e-9);
  EXPECT_GT(shrunk->volume, 0.5 * hull->volume);
  EXPECT_FALSE(Shrunk(*hull, 1));
  const auto box = HullOf(BoxMesh({1, 2, 3}).vertices);
  EXPECT_NEAR(box->volume, 6, 1e-9);
  EXPECT_NEAR(Shrunk(*box, 0.25)->volume, 0.5 * 1.5 * 2.5, 1e-9);
}

TEST(ConvexHull, FlatPointsHaveNone) {
  EXPECT_FALSE(HullOf(std::vector<Vector3d>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}));
  EXPECT_FALSE(HullOf(std::vector<Vector3d>(9, Vector3d(1, 2, 3))));
  EXPECT_FALSE(HullOf(std::vector<Vector3d>{}));
}

TEST(RobotParts, ConvexMeshIsOnePartThatAddsNothing) {
  const auto parts = PartsOfMesh(CylinderMesh(0.1, 0.5));
  ASSERT_TRUE(parts.ok()) << parts.status();
  EXPECT_EQ(parts->parts().size(), 1u);
  // What the bound may be above, and what fewer points add.
  EXPECT_LT(parts->excess()[0], 0.0025 + 0.001);
  // Nearly all of it is certain, but for the tolerance.
  const auto inner = HullOf(VectorOf(parts->parts()[0].inner));
  ASSERT_TRUE(inner);
  EXPECT_NEAR(inner->volume, std::numbers::pi * 0.095 * 0.095 * 0.49, 0.0003);
}

TEST(RobotParts, ConcaveMeshIsCutAndNothingOfItIsLost) {
  Random random;
  const TriangleMesh ring = TorusMesh(0.2, 0.05);
  const MeshPieces pieces = PiecesOf(ring, 0.01, 16);
  EXPECT_GT(pieces.hulls.size(), 6u);
  EXPECT_LE(pieces.hulls.size(), 16u);
  EXPECT_LT(pieces.excess, 0.012);
  for (int i = 0; i < 20000; ++i) {
    const Vector3d point = SurfacePoint(random, ring);
    ASSERT_TRUE(std::ranges::any_of(pieces.hulls, [&](const ConvexBody& hull) {
      return hull.Depth(point) >= -1e-9;
    })) << point.transpose();
  }
  // One hull fills the hole.
  EXPECT_GT(PiecesOf(ring, 0.01, 1).excess, 0.12);
}

TEST(RobotParts, RoundMeshesKeepFewPointsAndLoseNothing) {
  Random random;
  TriangleMesh egg;
  for (const Vector3d& vertex : SphereMesh(1).vertices) {
    egg.vertices.emplace_back(vertex.cwiseProduct(Vector3d(0.1, 0.15, 0.3)));
  }
  egg.triangles = SphereMesh(1).triangles;
  const ConvexBody hull = HullOf(egg.vertices).value();
  const FewPoints few = FewPointsOf(hull, 0.001, 160);
  EXPECT_LT(few.points.size(), hull.vertices.size() / 2);
  EXPECT_LE(few.radius, 0.006);
  const ConvexBody inner = HullOf(few.points).value();
  TriangleMesh surface;
  surface.vertices = inner.vertices;
  for (const auto& corners : inner.triangles) surface.triangles.push_back(corners);
  const MeshTree tree(surface);
  for (const Vector3d& vertex : hull.vertices) {
    uint32_t hint = 0;
    ASSERT_TRUE(inner.Depth(vertex) >= 0 || tree.Distance(vertex, hint) <= few.radius + 1e-9);
  }
}

TEST(RobotParts, ExcessBoundsWhatAnyLineOfSightAdds) {
  Random random;
  const TriangleMesh ring = TorusMesh(0.2, 0.05);
  const MeshTree tree(ring);
  for (const size_t most : {1u, 6u, 16u}) {
    const MeshPieces pieces = PiecesOf(ring, 0.01, most);
    double greatest = 0;
    for (int i = 0; i < 800; ++i) {
      // A line through a random point of a hull: how near it comes to the mesh.
      const auto& hull = pieces.hulls[random() % pieces.hulls.size()];
      const auto& corners = hull.triangles[random() % hull.triangles.size()];
      const double share = Uniform(random, 0, 1);
      const Vector3d side =
          (1 - share) * hull.vertices[corners[0]] + share * hull.vertices[corners[1]];
      const Vector3d at = side + Uniform(random, 0, 1) * (hull.vertices[corners[2]] - side);
      const Vector3d along = RandomDirection(random);
      double nearest = 1;
      uint32_t hint = 0;
      for (double t = -0.6; t < 0.6; t += 0.004) {
        nearest = std::min(nearest, tree.Distance(at + t * along, hint));
      }
      greatest = std::max(greatest, nearest);
    }
    EXPECT_LE(greatest, pieces.excess + 0.002) << most;
    EXPECT_GT(pieces.excess, 0);
  }
}

TEST(RobotParts, WhatIsCertainIsInTheMesh) {
  Random random;
  PartSettings settings;
  settings.tolerance = 0.004;
  settings.most_parts = 24;
  TriangleMesh bent = BoxMesh({0.4, 0.1, 0.1});
  for (const TriangleMesh& mesh : {TorusMesh(0.2, 0.08), bent}) {
    const MeshTree tree(mesh);
    const auto parts = PartsOfMesh(mesh, settings);
    ASSERT_TRUE(parts.ok()) << parts.status();
    int looks = 0;
    for (const RobotPart& part : parts->parts()) {
      for (int i = 0; i < 200 && part.inner.cols() > 0; ++i) {
        Vector3d point = Vector3d::Zero();
        double sum = 0;
        for (Eigen::Index k = 0; k < part.inner.cols(); ++k) {
          const double weight = std::pow(Uniform(random, 0, 1), 8);
          point += weight * part.inner.col(k);
          sum += weight;
        }
        point /= sum;
        uint32_t hint = 0;
        ASSERT_TRUE(Encloses(mesh, point));
        ASSERT_GE(tree.Distance(point, hint), settings.tolerance - 1e-9);
        ++looks;
      }
    }
    EXPECT_GT(looks, 0);
  }
}

TEST(RobotParts, OpenMeshIsDrawnAsIfClosedButNothingOfItIsCertain) {
  TriangleMesh mesh = BoxMesh({0.4, 0.2, 0.1});
  mesh.triangles.pop_back();
  const auto parts = PartsOfMesh(mesh);
  ASSERT_TRUE(parts.ok()) << parts.status();
  ASSERT_EQ(parts->parts().size(), 1u);
  EXPECT_EQ(parts->parts()[0].points.cols(), 8);
  EXPECT_EQ(parts->parts()[0].inner.cols(), 0);
  // The hole counts as closed.
  EXPECT_LT(parts->excess()[0], 0.003);
}

TriangleMesh Joined(TriangleMesh mesh, const TriangleMesh& other, const Vector3d& at) {
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  for (const Vector3d& vertex : other.vertices) mesh.vertices.emplace_back(vertex + at);
  for (const auto& [a, b, c] : other.triangles) {
    mesh.triangles.push_back({first + a, first + b, first + c});
  }
  return mesh;
}

// As files of robots have them that were made for looks.
std::vector<TriangleMesh> StrangeMeshes() {
  TriangleMesh inside_out = BoxMesh({0.2, 0.1, 0.3});
  for (auto& corners : inside_out.triangles) std::swap(corners[0], corners[1]);
  TriangleMesh twice = Joined(BoxMesh({0.2, 0.2, 0.2}), BoxMesh({0.2, 0.2, 0.2}), {0, 0, 0});
  TriangleMesh slivers = CylinderMesh(0.1, 0.4);
  slivers.triangles.push_back({0, 0, 1});
  slivers.triangles.push_back({0, 1, 1});
  TriangleMesh gutter = BoxMesh({0.5, 0.2, 0.2});
  std::erase_if(gutter.triangles, [&](const auto& corners) {
    return std::ranges::all_of(corners, [&](uint32_t at) { return gutter.vertices[at].z() > 0; });
  });
  return {Joined(BoxMesh({0.6, 0.08, 0.08}), BoxMesh({0.08, 0.08, 0.5}), {0.26, 0, 0.25}),
          Joined(SphereMesh(0.1), SphereMesh(0.1), {0.5, 0, 0}),  // of two pieces
          Joined(SphereMesh(0.2), SphereMesh(0.1), {0, 0, 0}),    // one in the other
          Joined(TorusMesh(0.15, 0.02), CylinderMesh(0.01, 0.6), {0, 0, 0.2}),
          BoxMesh({0.4, 0.3, 0.0002}),
          BoxMesh({0.6, 0.002, 0.002}),
          SphereMesh(0.001),
          inside_out,
          twice,
          slivers,
          gutter};
}

TEST(RobotParts, NothingOfAStrangeMeshIsLostAndWhatIsCertainIsInIt) {
  Random random;
  const PartSettings settings;
  const std::vector<TriangleMesh> meshes = StrangeMeshes();
  // With a sanitizer every third.
  const size_t step = SampleCount(10) < 10 ? 3 : 1;
  for (size_t number = 0; number < meshes.size(); number += step) {
    const TriangleMesh& mesh = meshes[number];
    const auto parts = PartsOfMesh(mesh);
    ASSERT_TRUE(parts.ok()) << number << ": " << parts.status();
    struct Outer {
      ConvexBody hull;
      MeshTree surface;
      double radius;
    };
    std::vector<Outer> outer;
    for (const RobotPart& part : parts->parts()) {
      const ConvexBody hull = HullOf(VectorOf(part.points)).value();
      outer.push_back({hull, MeshTree({hull.vertices, hull.triangles}), part.radius});
      for (Eigen::Index i = 0; i < part.inner.cols(); ++i) {
        const Vector3d at = part.inner.col(i);
        uint32_t hint = 0;
        EXPECT_TRUE(Encloses(mesh, at)) << number;
        EXPECT_GE(MeshTree(mesh).Distance(at, hint), settings.tolerance - 1e-9) << number;
      }
    }
    for (int i = 0; i < SampleCount(2000); ++i) {
      const Vector3d point = SurfacePoint(random, mesh);
      ASSERT_TRUE(std::ranges::any_of(outer,
                                      [&](const Outer& part) {
                                        uint32_t hint = 0;
                                        return part.hull.Depth(point) >= -1e-9 ||
                                               part.surface.Distance(point, hint) <=
                                                   part.radius + 1e-9;
                                      }))
          << number << ": " << point.transpose();
    }
  }
}

TEST(RobotParts, PartsRoundAboutTheirAxisMoveWithTheLinkBefore) {
  const auto robot =
      RobotModel::FromUrdf(SourceFolder() + "/capture/sim/robots/rx130.urdf").value();
  const auto parts = RobotParts::Of(robot, {});
  ASSERT_TRUE(parts.ok()) << parts.status();
  EXPECT_EQ(parts->parts().size(), 18u);
  const auto name = [&](size_t link) { return robot.links()[link].name; };
  size_t moved = 0;
  for (const RobotPart& part : parts->parts()) {
    EXPECT_GT(part.inner.cols(), 0);
    EXPECT_TRUE(name(part.link) != "forearm" || name(part.moves_with) == "elbow");
    EXPECT_TRUE(name(part.link) != "flange" || name(part.moves_with) == "wrist");
    EXPECT_TRUE(name(part.link) != "tool" || name(part.moves_with) == "flange");
    if (part.link != part.moves_with) ++moved;
  }
  // Of shoulder, upper arm, elbow, forearm (2), wrist, flange; and the tool (3), which is fixed.
  EXPECT_EQ(moved, 10u);
}

TEST(RobotParts, BadMeshesAreOneSentence) {
  const auto error = [](TriangleMesh mesh, const PartSettings& settings = {}) {
    return std::string(PartsOfMesh(std::move(mesh), settings).status().message());
  };
  TriangleMesh flat = BoxMesh({0.4, 0.2, 0.1});
  for (Vector3d& vertex : flat.vertices) vertex.z() = 0.3;
  EXPECT_THAT(error(flat), AllOf(HasSubstr("link 'hand'"), HasSubstr("'hand.stl' is flat")));
  PartSettings settings;
  settings.most_triangles = 11;
  EXPECT_THAT(error(BoxMesh({0.4, 0.2, 0.1}), settings),
              AllOf(HasSubstr("has 12 triangles, at most 11"), HasSubstr("simplify it")));
}

TEST(RobotParts, RobotWithoutGeometryIsRefused) {
  const auto robot = RobotModel::FromUrdf(
      WriteFile(FreshFolder() / "r.urdf", "<robot name='r'><link name='a'/></robot>"));
  ASSERT_TRUE(robot.ok());
  EXPECT_THAT(std::string(RobotParts::Of(*robot, {}).status().message()),
              AllOf(HasSubstr("no visual or collision geometry"),
                    HasSubstr("give its links visual or collision geometry in the URDF")));
}

// Meshes and URDFs of robots that somebody else made.
TEST(RobotModel, LoopsAndBrokenMeshesAreOneSentence) {
  const auto folder = FreshFolder();
  const auto error = [&](const std::string& urdf) {
    const auto robot = RobotModel::FromUrdf(WriteFile(folder / "r.urdf", urdf));
    return std::string(robot.status().message());
  };
  const auto joint = [](const std::string& name, const std::string& a, const std::string& b) {
    return "<joint name='" + name + "' type='fixed'><parent link='" + a + "'/><child link='" + b +
           "'/></joint>";
  };
  const std::string links = "<link name='a'/><link name='b'/><link name='c'/>";
  EXPECT_THAT(error("<robot name='r'>" + links + joint("j", "a", "b") + joint("k", "b", "c") +
                    joint("l", "c", "a") + "</robot>"),
              HasSubstr("not a valid URDF"));
  EXPECT_THAT(
      error("<robot name='r'>" + links + joint("j", "b", "c") + joint("k", "c", "b") + "</robot>"),
      AllOf(HasSubstr("loop"), HasSubstr("leave out a joint")));
  EXPECT_THAT(error("<robot name='r'>" + links + joint("j", "a", "b") + joint("k", "b", "c") +
                    joint("l", "c", "b") + "</robot>"),
              AllOf(HasSubstr("link 'b' hangs on two joints, 'j' and 'l'"), HasSubstr("loop")));
  EXPECT_THAT(error("<robot name='r'>" + links + joint("j", "a", "b") + joint("k", "a", "c") +
                    joint("l", "b", "c") + "</robot>"),
              HasSubstr("link 'c' hangs on two joints"));
  const std::string mesh =
      "<robot name='r'><link name='a'><visual><geometry><mesh filename='link.stl'/></geometry>"
      "</visual></link></robot>";
  WriteFile(folder / "link.stl", "");
  EXPECT_THAT(error(mesh), AllOf(HasSubstr("link 'a'"), HasSubstr("link.stl")));
  std::string bad = TetrahedronStl();
  bad.replace(bad.find("1 0 0"), 5, "nan 0 0");
  WriteFile(folder / "link.stl", bad);
  EXPECT_THAT(error(mesh), AllOf(HasSubstr("link 'a'"), HasSubstr("link.stl")));
}

}  // namespace
}  // namespace silhouette
