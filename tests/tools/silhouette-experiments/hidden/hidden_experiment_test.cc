// In a cell with real meshes, through cameras, images and differencing: what the robot hides from
// all views is found by the sound presets, and only by them.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>

#include "server/scene/checker.h"
#include "tests/test_folder.h"
#include "tools/silhouette-experiments/hidden/study.h"

namespace silhouette::hidden_experiment {
namespace {

const std::string kFolder = std::string(SILHOUETTE_SOURCE_DIR) + "/capture/sim/cells/hidden/";
constexpr int kScenes = 4;

class HiddenObstacles : public testing::Test {
 protected:
  // The cell of the experiment on a coarser grid, captured once for all tests.
  static void SetUpTestSuite() {
    const std::string folder = TestFolder().string();
    std::ifstream in(kFolder + "cell.yaml");
    std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    text = std::regex_replace(text, std::regex("steps: .*"), "steps: {joint_1: 13, joint_3: 5}");
    text = std::regex_replace(text, std::regex("simulation: "), "simulation: " + kFolder);
    text = std::regex_replace(text, std::regex("urdf: "), "urdf: " + kFolder);
    std::ofstream(folder + "/cell.yaml") << text;
    auto captured = HiddenCell::Capture(folder + "/cell.yaml", folder + "/db",
                                        [](uint64_t, uint64_t) { return true; });
    ASSERT_TRUE(captured.ok()) << captured.status();
    cell_ = std::make_unique<HiddenCell>(*std::move(captured));
    for (uint64_t seed = 1; seed <= kScenes; ++seed) {
      const auto ball = FindHiddenBall(*cell_, cell_->least_obstacle(), seed);
      ASSERT_TRUE(ball.has_value()) << "seed " << seed;
      balls_.push_back(*ball);
    }
  }
  static void TearDownTestSuite() {
    cell_.reset();
    balls_.clear();
  }

  static Tally JudgeAll(Preset preset, bool with_ball) {
    Tally tally;
    for (const HiddenBall& ball : balls_) {
      std::vector<Obstacle> obstacles;
      if (with_ball) obstacles.push_back(ObstacleOf(ball));
      tally += Judge(*cell_, cell_->SceneAt(ball.robot, std::move(obstacles)), preset,
                     with_ball ? ball.touches : std::vector<bool>(ball.touches.size(), false));
    }
    return tally;
  }

  static std::unique_ptr<HiddenCell> cell_;
  static std::vector<HiddenBall> balls_;
};
std::unique_ptr<HiddenCell> HiddenObstacles::cell_;
std::vector<HiddenBall> HiddenObstacles::balls_;

TEST_F(HiddenObstacles, AreSeenByNoCamera) {
  for (const HiddenBall& ball : balls_) {
    const Served served = cell_->SceneAt(ball.robot, {ObstacleOf(ball)});
    EXPECT_EQ(served.scene->Blocked(), Reason::kNone);
    for (const auto& image : served.scene->obstacle_images) {
      EXPECT_TRUE(image->obstacle().Empty());
    }
  }
}

TEST_F(HiddenObstacles, AreAlwaysFoundByTheSoundPresets) {
  for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
    const Tally tally = JudgeAll(preset, true);
    EXPECT_GE(tally.touching, kScenes);
    EXPECT_EQ(tally.found, tally.touching) << NameOf(preset);
  }
}

TEST_F(HiddenObstacles, AreFoundByNoOtherPreset) {
  for (const Preset preset : {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated}) {
    EXPECT_EQ(JudgeAll(preset, true).found, 0) << NameOf(preset);
  }
}

TEST_F(HiddenObstacles, DoNotBlockTheRest) {
  const Tally with_ball = JudgeAll(Preset::kSound, true);
  EXPECT_GT(with_ball.kept, with_ball.clear / 2);
  const Tally empty = JudgeAll(Preset::kSound, false);
  EXPECT_GT(empty.kept, empty.clear / 2);
}

TEST_F(HiddenObstacles, AreWhatSoundIsTheDefaultFor) {
  EXPECT_EQ(cell_->database().BestPreset(), Preset::kSound);
  EXPECT_TRUE(cell_->database().CanServe({.preset = Preset::kSound}).ok());
}

TEST_F(HiddenObstacles, ShowInTheCollisionImagesOfTheSoundPresets) {
  const HiddenBall& ball = balls_.front();
  const Served served = cell_->SceneAt(ball.robot, {ObstacleOf(ball)});
  ConfigurationNumber touching = 0;
  while (!ball.touches[touching]) ++touching;
  const Configuration q = cell_->grid().At(touching);
  const SceneSettings settings{.max_age = absl::InfiniteDuration()};
  const auto any_in_all_views = [&](Preset preset) {
    const Checker checker(served, {.preset = preset}, settings, SystemClock());
    const CollisionImages images = checker.CollisionImagesAt(q);
    return std::all_of(images.begin(), images.end(),
                       [](const std::optional<Mask>& image) { return image && !image->Empty(); });
  };
  EXPECT_TRUE(any_in_all_views(Preset::kSound));
  EXPECT_FALSE(any_in_all_views(Preset::kCalibrated));
}

TEST_F(HiddenObstacles, AreNeverFreeWhereAViewIsMissing) {
  const HiddenBall& ball = balls_.front();
  Scene scene = *cell_->SceneAt(ball.robot, {ObstacleOf(ball)}).scene;
  scene.views[0].reset();
  scene.obstacle_images[0].reset();
  const Served served{std::shared_ptr<const ServedDatabase>(&cell_->database(), [](auto*) {}),
                      std::make_shared<const Scene>(std::move(scene)), Reason::kNone};
  for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
    const Tally tally = Judge(*cell_, served, preset, ball.touches);
    EXPECT_EQ(tally.found, tally.touching);
    EXPECT_EQ(tally.kept, 0);
  }
}

}  // namespace
}  // namespace silhouette::hidden_experiment
