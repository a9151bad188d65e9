// SPDX-License-Identifier: Apache-2.0
// In a cell with real meshes, through cameras, images and background subtraction: the sound
// presets, and only they, find what the robot hides from all views.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <regex>

#include "calib/robot/robot_model.h"
#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/db/store/test_cell.h"
#include "tests/folders.h"
#include "tools/silhouette-experiments/cell/missing_picture.h"
#include "tools/silhouette-experiments/cell/scenes.h"
#include "tools/silhouette-experiments/cell/trial.h"

namespace silhouette::cell_experiment {
namespace {

const std::string kHiddenFolder = SourceFolder() + "/capture/sim/cells/hidden/";
constexpr int kHiddenScenes = 4;

class HiddenObstacles : public testing::Test {
 protected:
  // The cell of the experiment on a coarser grid, captured once for all tests.
  static void SetUpTestSuite() {
    const std::filesystem::path folder = FreshFolder();
    std::ifstream in(kHiddenFolder + "cell.yaml");
    std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    text = std::regex_replace(text, std::regex("steps: .*"), "steps: {joint_1: 13, joint_3: 5}");
    text = std::regex_replace(text, std::regex("simulation: "), "simulation: " + kHiddenFolder);
    text = std::regex_replace(text, std::regex("urdf: "), "urdf: " + kHiddenFolder);
    std::ofstream(folder / "cell.yaml") << text;
    auto loaded = SimulatedWorkplace::Load(folder / "cell.yaml");
    ASSERT_TRUE(loaded.ok()) << loaded.status();
    workplace_ = std::make_unique<SimulatedWorkplace>(*std::move(loaded));
    database_ = (folder / "db").string();
    const auto database = workplace_->OpenOrCapture(database_, {});
    ASSERT_TRUE(database.ok()) << database.status();
    const auto served = workplace_->Serve(**database, {});
    ASSERT_TRUE(served.ok()) << served.status();
    served_ = *served;
    std::vector<Policy> policies;
    for (const Preset preset : AllPresets()) policies.push_back({.preset = preset});
    setting_.reset(new TrialSetting{
        .workplace = *workplace_, .database = *served_, .policies = std::move(policies)});
    for (int number = 0; number < kHiddenScenes; ++number) {
      const double radius = workplace_->cell().sound->least_obstacle;
      auto scene = MakeHiddenScene(*workplace_, radius, 1, number);
      ASSERT_TRUE(scene.has_value()) << "scene " << number;
      scenes_.push_back(*std::move(scene));
    }
  }
  static void TearDownTestSuite() {
    scenes_.clear();
    setting_.reset();
    served_.reset();
    workplace_.reset();
  }

  static ViewedScene Viewed(int number, bool with_ball = true) {
    RandomScene scene = scenes_[static_cast<size_t>(number)];
    if (!with_ball) scene.obstacles.clear();
    return View(*setting_, std::move(scene), number).value();
  }
  // Over all scenes and the configurations of the grid.
  static Tally JudgeAll(Preset preset, bool with_ball = true) {
    Tally sum;
    for (int number = 0; number < kHiddenScenes; ++number) {
      const TrialResult result = Judge(*setting_, Viewed(number, with_ball), number);
      EXPECT_EQ(result.blocked, Reason::kNone);
      sum.Add(result.tallies[static_cast<size_t>(preset)][kOnGrid]);
    }
    return sum;
  }
  static Served ServedOf(Scene scene) {
    return {served_, std::make_shared<const Scene>(std::move(scene)), Reason::kNone};
  }

  static std::string database_;
  static std::unique_ptr<SimulatedWorkplace> workplace_;
  static std::shared_ptr<const ServedDatabase> served_;
  static std::unique_ptr<const TrialSetting> setting_;
  static std::vector<RandomScene> scenes_;
};
std::string HiddenObstacles::database_;
std::unique_ptr<SimulatedWorkplace> HiddenObstacles::workplace_;
std::shared_ptr<const ServedDatabase> HiddenObstacles::served_;
std::unique_ptr<const TrialSetting> HiddenObstacles::setting_;
std::vector<RandomScene> HiddenObstacles::scenes_;

TEST_F(HiddenObstacles, AreSeenByNoCamera) {
  for (int number = 0; number < kHiddenScenes; ++number) {
    const ViewedScene viewed = Viewed(number);
    EXPECT_EQ(viewed.scene.Blocked(), Reason::kNone);
    for (const auto& image : viewed.scene.obstacle_images) {
      EXPECT_TRUE(image->obstacle().Empty());
    }
  }
}

TEST_F(HiddenObstacles, AreAlwaysFoundByTheSoundPresets) {
  for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
    const Tally tally = JudgeAll(preset);
    EXPECT_GE(tally.occupied, uint64_t{kHiddenScenes});
    EXPECT_EQ(tally.missing, 0u) << NameOf(preset);
  }
}

TEST_F(HiddenObstacles, AreFoundByNoOtherPreset) {
  for (const Preset preset : {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated}) {
    const Tally tally = JudgeAll(preset);
    EXPECT_EQ(tally.missing, tally.occupied) << NameOf(preset);
  }
}

TEST_F(HiddenObstacles, DoNotBlockTheRest) {
  for (const bool with_ball : {true, false}) {
    const Tally tally = JudgeAll(Preset::kSound, with_ball);
    EXPECT_LT(tally.additional, (tally.tested - tally.occupied) / 2);
  }
}

// Nothing is certain then of the hood.
TEST_F(HiddenObstacles, AreFoundByARobotOfOpenMeshesWhichDoesNotBlockAll) {
  const std::filesystem::path folder = FreshFolder();
  std::ofstream(folder / "open.obj")
      << "v -0.5 -0.5 -0.5\nv 0.5 -0.5 -0.5\nv 0.5 0.5 -0.5\nv -0.5 0.5 -0.5\n"
         "v -0.5 -0.5 0.5\nv 0.5 -0.5 0.5\nv 0.5 0.5 0.5\nv -0.5 0.5 0.5\n"
         "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\n";
  std::ifstream in(SourceFolder() + "/capture/sim/robots/rx130_hood.urdf");
  std::string urdf((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  urdf = std::regex_replace(urdf, std::regex("<box size=(?=\"[^\"]*0\\.02)"),
                            "<mesh filename=\"open.obj\" scale=");
  std::ofstream(folder / "robot.urdf") << urdf;
  Cell cell = workplace_->cell();
  auto robot = RobotModel::FromUrdf(folder / "robot.urdf");
  ASSERT_TRUE(robot.ok()) << robot.status();
  cell.robot.model = std::make_shared<const RobotModel>(*std::move(robot));
  const auto sound = SoundCellOf(cell);
  ASSERT_TRUE(sound.ok()) << sound.status();
  const auto database = Database::Open(database_, Database::Access::kRead);
  ASSERT_TRUE(database.ok()) << database.status();
  const auto opened = ServedDatabase::Load(
      **database, cell.calibration, {.views = {}, .workspace = (*sound)->workspace}, *sound, {});
  ASSERT_TRUE(opened.ok()) << opened.status();
  ASSERT_EQ((*opened)->sound()->open_links(), std::vector<std::string>{"tool"});
  const TrialSetting setting{
      .workplace = *workplace_, .database = **opened, .policies = {{.preset = Preset::kSound}}};
  for (const bool with_ball : {true, false}) {
    Tally tally;
    for (int number = 0; number < kHiddenScenes; ++number) {
      tally.Add(Judge(setting, Viewed(number, with_ball), number).tallies[0][kOnGrid]);
    }
    EXPECT_EQ(tally.missing, 0u);
    EXPECT_LT(tally.additional, (tally.tested - tally.occupied) / 2);
  }
}

TEST_F(HiddenObstacles, AreWhatSoundIsTheDefaultFor) {
  EXPECT_EQ(served_->BestPreset(), Preset::kSound);
  EXPECT_TRUE(served_->CanServe({.preset = Preset::kSound}).ok());
}

TEST_F(HiddenObstacles, ShowInTheCollisionImagesOfTheSoundPresets) {
  ViewedScene viewed = Viewed(0);
  const ContactChecker contact(workplace_->robot(), viewed.truth.obstacles);
  const Poses ball = ObstaclePoses(viewed.truth.obstacles, 0);
  const ConfigurationGrid& grid = served_->grid();
  ConfigurationNumber touching = 0;
  while (!grid.Contains(touching) ||
         !contact.Touches(workplace_->LinkPoses(grid.At(touching)), ball)) {
    ASSERT_LT(++touching, grid.number_limit());
  }
  const Served served = ServedOf(std::move(viewed.scene));
  const SceneSettings settings{.max_age = absl::InfiniteDuration()};
  const auto any_in_all_views = [&](Preset preset) {
    const Checker checker(served, {.preset = preset}, settings, SystemClock());
    const CollisionImages images = checker.CollisionImagesAt(grid.At(touching));
    return std::all_of(images.begin(), images.end(),
                       [](const std::optional<Mask>& image) { return image && !image->Empty(); });
  };
  EXPECT_TRUE(any_in_all_views(Preset::kSound));
  EXPECT_FALSE(any_in_all_views(Preset::kCalibrated));
}

TEST_F(HiddenObstacles, AreNeverFreeWhereAViewIsMissing) {
  Scene scene = Viewed(0).scene;
  scene.views[0].reset();
  scene.obstacle_images[0].reset();
  const Served served = ServedOf(std::move(scene));
  for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
    const ConfigurationSpace space(served, {.preset = preset});
    for (uint64_t at = 0; at < space.tiles(); ++at) {
      const TileVerdicts& tile = space.tile(at);
      EXPECT_TRUE(std::ranges::all_of(tile.free, [](uint64_t word) { return word == 0; }));
    }
  }
}

TEST_F(HiddenObstacles, AreDrawnWhereTheSoundPresetsSayThatTheyMayBe) {
  const Picture picture = DrawPossible(*setting_, Viewed(0));
  EXPECT_GT(picture.cols, served_->views() * 4 * 128);
}

}  // namespace
}  // namespace silhouette::cell_experiment
