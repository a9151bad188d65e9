// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/obstacles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/calib/robot/urdf_files.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;

absl::StatusOr<std::vector<Obstacle>> ObstaclesLoad(const std::string& text) {
  return LoadObstacles(WriteFile(FreshFolder() / "scene.yaml", text));
}

std::string ObstaclesErrorOf(const std::string& text) {
  const auto obstacles = ObstaclesLoad(text);
  return obstacles.ok() ? "no error" : std::string(obstacles.status().message());
}

TEST(SceneFile, EveryShapeIsRead) {
  const auto folder = FreshFolder();
  WriteFile(folder / "part.stl", TetrahedronStl());
  const auto obstacles = LoadObstacles(WriteFile(folder / "scene.yaml", R"(
obstacles:
  - {name: a, box: {size: [1, 2, 3]}, position: [1, 0, 0], rotation: [0, 0, 90 deg], brightness: 0.5}
  - {name: b, sphere: {radius: 0.5}, position: [0, 0, 0]}
  - {name: c, capsule: {radius: 0.2, length: 1}, position: [0, 0, 0]}
  - {name: d, cylinder: {radius: 0.2, length: 1}, position: [0, 0, 0]}
  - {name: e, mesh: {file: part.stl, scale: [2, 2, 2]}, position: [0, 0, 0]}
)"));
  ASSERT_TRUE(obstacles.ok()) << obstacles.status();
  ASSERT_EQ(obstacles->size(), 5u);
  const Obstacle& box = obstacles->front();
  EXPECT_EQ(box.brightness, 0.5);
  EXPECT_TRUE((box.PoseAt(7) * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(1, 1, 0)));
  const auto top = [&](size_t i) {
    double z = 0;
    for (const auto& vertex : (*obstacles)[i].mesh.vertices) z = std::max(z, vertex.z());
    return z;
  };
  EXPECT_DOUBLE_EQ(top(0), 1.5);
  EXPECT_DOUBLE_EQ(top(1), 0.5);
  EXPECT_DOUBLE_EQ(top(2), 0.7);
  EXPECT_DOUBLE_EQ(top(3), 0.5);
  EXPECT_DOUBLE_EQ(top(4), 2);
}

TEST(SceneFile, ObstaclesMoveByVelocityOrAlongWaypoints) {
  const auto obstacles = ObstaclesLoad(R"(
obstacles:
  - {name: cart, box: {size: [1, 1, 1]}, position: [0, 0, 1], velocity: [0.5, 0, 0]}
  - name: walker
    sphere: {radius: 1}
    position: [9, 9, 9]
    waypoints:
      - {time: 1, position: [0, 0, 0]}
      - {time: 3 s, position: [2, 4, 0]}
)")
                             .value();
  const auto place = [&](size_t i, double time) -> Eigen::Vector3d {
    return obstacles[i].PoseAt(time).translation();
  };
  EXPECT_TRUE(place(0, 0).isApprox(Eigen::Vector3d(0, 0, 1)));
  EXPECT_TRUE(place(0, 4).isApprox(Eigen::Vector3d(2, 0, 1)));
  EXPECT_TRUE(place(1, 0).isZero());
  EXPECT_TRUE(place(1, 2).isApprox(Eigen::Vector3d(1, 2, 0)));
  EXPECT_TRUE(place(1, 99).isApprox(Eigen::Vector3d(2, 4, 0)));
}

TEST(SceneFile, EmptySceneIsAScene) {
  const auto obstacles = ObstaclesLoad("obstacles: []\n");
  ASSERT_TRUE(obstacles.ok());
  EXPECT_TRUE(obstacles->empty());
}

TEST(SceneFile, MistakesAreToldWithFileAndLine) {
  EXPECT_THAT(ObstaclesErrorOf("obstacles:\n  - {name: a, position: [0, 0, 0]}\n"),
              AllOf(HasSubstr("scene.yaml:2"), HasSubstr("a shape is missing")));
  EXPECT_THAT(ObstaclesErrorOf(
                  "obstacles:\n  - name: a\n    sphere: {radius: -1}\n    position: [0, 0, 0]\n"),
              AllOf(HasSubstr("scene.yaml:3"), HasSubstr("greater than 0")));
  EXPECT_THAT(
      ObstaclesErrorOf("obstacles:\n  - {name: a, sphere: {radius: 1}, box: {size: [1, 1, 1]}, "
                       "position: [0, 0, 0]}\n"),
      HasSubstr("one shape"));
  EXPECT_THAT(
      ObstaclesErrorOf("obstacles:\n  - {name: a, sphere: {radius: 1}, position: [0, 0]}\n"),
      HasSubstr("a list of 3 is expected"));
  EXPECT_THAT(
      ObstaclesErrorOf("obstacles:\n  - {name: a, sphere: {radius: 1}, positon: [0, 0, 0]}\n"),
      HasSubstr("position"));
  EXPECT_THAT(ObstaclesErrorOf("obstacles:\n"
                               "  - {name: a, sphere: {radius: 1}, position: [0, 0, 0]}\n"
                               "  - {name: a, sphere: {radius: 1}, position: [0, 0, 0]}\n"),
              AllOf(HasSubstr("scene.yaml:3"), HasSubstr("called 'a'")));
  EXPECT_THAT(ObstaclesErrorOf("obstacles:\n  - name: a\n    mesh: {file: missing.stl}\n"
                               "    position: [0, 0, 0]\n"),
              AllOf(HasSubstr("scene.yaml:3"), HasSubstr("missing.stl")));
  EXPECT_THAT(
      ObstaclesErrorOf("obstacles:\n  - name: a\n    sphere: {radius: 1}\n    position: [0, 0, 0]\n"
                       "    waypoints:\n      - {time: 2, position: [0, 0, 0]}\n"
                       "      - {time: 1, position: [0, 0, 0]}\n"),
      AllOf(HasSubstr("scene.yaml:7"), HasSubstr("must grow")));
  EXPECT_THAT(std::string(LoadObstacles("/nowhere.yaml").status().message()),
              HasSubstr("/nowhere.yaml"));
}

}  // namespace
}  // namespace silhouette
