// SPDX-License-Identifier: Apache-2.0
// Scenes of the small cell whose robot images are drawn, and what its robot touches in truth.
#pragma once

#include <gmock/gmock.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "server/scene/checker.h"
#include "tests/random.h"
#include "tests/server/drawn_cell.h"

namespace silhouette {

inline const Moment kDrawnNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

struct DrawnSceneTest : ::testing::Test {
  absl::StatusOr<std::shared_ptr<const ServedDatabase>> Load(const LoadSettings& load) {
    const auto opened = Database::Open(folder / "db", Database::Access::kRead);
    EXPECT_TRUE(opened.ok()) << opened.status();
    return ServedDatabase::Load(**opened, {.margin = margin}, {}, sound, load);
  }

  std::shared_ptr<const ServedDatabase> New() {
    EXPECT_TRUE(Database::Create(folder / "db", DrawnCellDescription()).ok());
    auto loaded = Load({.calibration = calibration, .drawn = cell});
    EXPECT_TRUE(loaded.ok()) << loaded.status();
    return *loaded;
  }

  Configuration Any() {
    return {std::uniform_real_distribution<double>(-4, 4)(random),
            std::uniform_real_distribution<double>(-2, 2)(random)};
  }

  bool Touches(const Configuration& q, const std::vector<DrawnCellBall>& balls) const {
    const std::vector<Eigen::Isometry3d> poses =
        model->LinkPoses(std::vector<double>{q[0], q[1], 0.1});
    for (size_t link = 0; link < poses.size(); ++link) {
      const LinkGeometry& geometry = model->links()[link].visual[0];
      const Eigen::Vector3d half = std::get<BoxShape>(geometry.shape).size / 2;
      const Eigen::AlignedBox3d box(-half, half);
      for (const DrawnCellBall& ball : balls) {
        const Eigen::Vector3d at = (poses[link] * geometry.link_from_shape).inverse() * ball.centre;
        if (box.exteriorDistance(at) <= ball.radius) return true;
      }
    }
    return false;
  }

  SceneInput InputOf(const Configuration& now, const std::vector<DrawnCellBall>& balls) const {
    return DrawnSceneInput(*truth, now, balls);
  }

  Served ServedScene(const SceneInput& input) const {
    absl::StatusOr<Scene> scene = MakeScene(*database, input, settings, {}, kDrawnNow);
    EXPECT_TRUE(scene.ok()) << scene.status();
    scene->id = 1;
    return {database, std::make_shared<const Scene>(*std::move(scene)), Reason::kNone};
  }
  Checker CheckerOf(const SceneInput& input, const Policy& policy = {}) const {
    return Checker(ServedScene(input), policy, settings, kDrawnNow);
  }

  std::vector<DrawnCellBall> SomeBalls(const Configuration& now, double least) {
    const auto between = [&](double a, double b) {
      return std::uniform_real_distribution<double>(a, b)(random);
    };
    while (true) {
      const std::vector<DrawnCellBall> balls = {
          {{between(-0.8, 0.8), between(-0.8, 0.8), between(0.2, 1.4)}, between(least, 0.15)}};
      if (!Touches(now, balls)) return balls;
    }
  }

  Random random;
  std::filesystem::path folder = FreshFolder();
  std::shared_ptr<const RobotModel> model = std::make_shared<const RobotModel>(DrawnModel());
  Calibration calibration = DrawnCalibration();
  DrawnCell cell{.robot = model, .parts = {}};
  std::optional<SoundCell> sound;
  double margin = 0;  // of the calibration
  std::shared_ptr<const ServedDatabase> database = New();
  // Without tolerance.
  std::shared_ptr<const DrawnRobot> truth = std::make_shared<const DrawnRobot>(
      DrawnRobotOf(*model, {}, std::vector<std::string>{"turn", "lift"},
                   std::vector<FixedJoint>{{"reach", 0.1}}, calibration,
                   std::vector<MaskSize>(4, kDrawnSize), 0)
          .value());
  SceneSettings settings;
};

inline SoundCell DrawnSoundCell(std::shared_ptr<const RobotModel> model) {
  return {.settings = {.least_obstacle = 0.09,
                       .voxel_edge = 0.03,
                       .model_tolerance = 0.005,
                       .whole_model = true},
          .workspace =
              Eigen::AlignedBox3d(Eigen::Vector3d(-1.1, -1.1, 0), Eigen::Vector3d(1.1, 1.1, 1.8)),
          .payload_radius = 0,
          .robot = std::move(model)};
}

struct DrawnSoundTest : DrawnSceneTest {
  DrawnSoundTest() {
    sound = DrawnSoundCell(model);
    auto loaded = Load({.calibration = calibration, .drawn = cell});
    EXPECT_TRUE(loaded.ok()) << loaded.status();
    database = *loaded;
  }
};

}  // namespace silhouette
