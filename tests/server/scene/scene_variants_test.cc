// SPDX-License-Identifier: Apache-2.0
// Variants: scenes and checks with each of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "absl/strings/substitute.h"
#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/random.h"
#include "tests/server/collision/sphere_world.h"
#include "tests/server/tool_variant.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Moment kSceneVariantsNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

std::shared_ptr<const Scene> SceneVariantsSceneOf(const ServedDatabase& whole,
                                                  const SceneInput& input) {
  absl::StatusOr<Scene> scene = MakeScene(whole, input, {}, {}, kSceneVariantsNow);
  EXPECT_TRUE(scene.ok()) << scene.status();
  scene->id = 1;
  return std::make_shared<const Scene>(*std::move(scene));
}

// What a request for the variant `name` rests on.
Served ServedWith(const std::shared_ptr<const ServedDatabase>& whole,
                  const std::shared_ptr<const Scene>& scene, const std::string& name) {
  Served served{whole, scene, Reason::kNone};
  const absl::StatusOr<Served> with_variant = WithVariant(served, name);
  EXPECT_TRUE(with_variant.ok()) << with_variant.status();
  return *with_variant;
}

// That both say the same of every configuration, on and off the grid and as a map.
void ExpectSame(const Served& one, const Served& other, const Policy& policy,
                std::mt19937_64& random) {
  const Checker a(one, policy, {}, kSceneVariantsNow);
  const Checker b(other, policy, {}, kSceneVariantsNow);
  const ConfigurationGrid& grid = one.database->grid();
  const ConfigurationSpace map_a(one, policy);
  const ConfigurationSpace map_b(other, policy);
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    ASSERT_EQ(map_a.state(number), map_b.state(number)) << number;
    if (!grid.Contains(number)) continue;
    ASSERT_EQ(a.Check(grid.At(number)), b.Check(grid.At(number)));
  }
  std::uniform_real_distribution<double> share(0, 1);
  for (int i = 0; i < 20; ++i) {
    const Configuration q = {4 * share(random), std::numbers::pi * (2 * share(random) - 1)};
    const Configuration to = {4 * share(random), std::numbers::pi * (2 * share(random) - 1)};
    ASSERT_EQ(a.Check(q), b.Check(q));
    const std::vector<Configuration> path = {q, to};
    ASSERT_EQ(a.CheckPath(path).verdict, b.CheckPath(path).verdict);
  }
}

struct SceneVariants : ::testing::TestWithParam<bool> {
  const std::filesystem::path folder = FreshFolder();
  // With both variants; with the default variant's images alone; with the tool's alone, as default.
  std::shared_ptr<const ServedDatabase> both;
  std::shared_ptr<const ServedDatabase> plain;
  std::shared_ptr<const ServedDatabase> tool;

  void SetUp() override {
    for (const char* name : {"both", "plain", "tool"}) {
      MakeDatabase(folder / name, {.calibration = TestCalibration()});
    }
    AddTools(folder / "both");
    {
      const auto database = Database::Open(folder / "tool", Database::Access::kWrite);
      ASSERT_TRUE(database.ok());
      PutTools(**database);
    }
    if (GetParam()) {
      for (const char* name : {"both", "plain", "tool"}) BuildIndex(folder / name);
    }
    both = LoadDatabase(folder / "both");
    plain = LoadDatabase(folder / "plain");
    tool = LoadDatabase(folder / "tool");
  }
};

// A scene and checks with the variant X say what a database says that has X as its only variant.
TEST_P(SceneVariants, AnswerAsADatabaseOfTheirOwn) {
  ASSERT_THAT(both->variants(), ElementsAre("default", kTool));
  Random random;
  for (int round = 0; round < 12; ++round) {
    const int a = static_cast<int>(random() % 4);
    const int b = static_cast<int>(random() % 8);
    const int block = static_cast<int>(random() % 5);
    const SceneInput without_tool = SceneWithBlock(block, 3, a, b);
    const SceneInput with_tool = ToolScene(a, b, block);
    SceneInput of_own = with_tool;
    of_own.variant = "";
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated}) {
      const Policy policy{.preset = preset};
      const auto tool_scene = SceneVariantsSceneOf(*both, with_tool);
      const auto plain_scene = SceneVariantsSceneOf(*both, without_tool);
      ExpectSame(ServedWith(both, tool_scene, ""),
                 ServedWith(tool, SceneVariantsSceneOf(*tool, of_own), ""), policy, random);
      ExpectSame(ServedWith(both, plain_scene, ""),
                 ServedWith(plain, SceneVariantsSceneOf(*plain, without_tool), ""), policy, random);
      // With another variant than the scene's: its obstacle images, the other's robot images.
      auto for_tool = std::make_shared<Scene>(*SceneVariantsSceneOf(*plain, without_tool));
      for_tool->generation = tool->generation();
      ExpectSame(ServedWith(both, plain_scene, kTool), ServedWith(tool, for_tool, ""), policy,
                 random);
      auto for_plain = std::make_shared<Scene>(*SceneVariantsSceneOf(*tool, of_own));
      for_plain->generation = plain->generation();
      ExpectSame(ServedWith(both, tool_scene, "default"), ServedWith(plain, for_plain, ""), policy,
                 random);
    }
  }
}

TEST_P(SceneVariants, TellTheToolFromAnObstacleInTheirOwnScenesOnly) {
  SceneInput input = ToolScene(0, 0, 4);
  const auto right = SceneVariantsSceneOf(*both, input);
  EXPECT_EQ(right->variant, kTool);
  input.variant = "";
  const auto wrong = SceneVariantsSceneOf(*both, input);
  EXPECT_EQ(wrong->variant, "default");
  const Mask only_tool = ToolMask(0, 0, 0) - RobotMask(0, 0, 0);
  ASSERT_FALSE(only_tool.Empty());
  EXPECT_FALSE(Intersects(right->obstacle_images[0]->obstacle().words(), only_tool.words()));
  EXPECT_TRUE(Intersects(wrong->obstacle_images[0]->obstacle().words(), only_tool.words()));
}

TEST_P(SceneVariants, AnUnknownVariantOfASceneIsNeverFree) {
  SceneInput input = EmptyCellScene();
  input.variant = "none";
  const auto scene = SceneVariantsSceneOf(*both, input);
  EXPECT_EQ(scene->Blocked(), Reason::kVariantUnknown);
  EXPECT_THAT(scene->defects[0].message, HasSubstr("'none'"));
  for (const char* variant : {"", "default", kTool}) {
    const Served served = ServedWith(both, scene, variant);
    const Checker checker(served, {}, {}, kSceneVariantsNow);
    EXPECT_EQ(checker.Check(At(3, 3)).reason(), Reason::kVariantUnknown);
    const ConfigurationSpace space(served, {});
    for (ConfigurationNumber number = 0; number < kTileSize; ++number) {
      EXPECT_EQ(space.state(number), State::kUnknown);
    }
  }
}

TEST_P(SceneVariants, AnUnknownVariantOfACheckIsRefused) {
  const absl::Status status =
      WithVariant({both, SceneVariantsSceneOf(*both, EmptyCellScene())}, "none").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("no variant 'none'; its variants are default, tool"));
}

TEST_P(SceneVariants, ASceneOfWhichTheVariantIsNotKnownIsNeverFree) {
  SceneInput input = EmptyCellScene();
  input.without_variant = "nobody has told";
  const auto scene = SceneVariantsSceneOf(*both, input);
  EXPECT_EQ(scene->variant, "");
  EXPECT_EQ(scene->Blocked(), Reason::kVariantUnknown);
  EXPECT_EQ(scene->defects[0].message, "nobody has told");
  EXPECT_EQ(scene->views.size(), 3u);
  for (const char* variant : {"", "default", kTool}) {
    const Checker checker(ServedWith(both, scene, variant), {}, {}, kSceneVariantsNow);
    EXPECT_EQ(checker.Check(At(3, 3)).reason(), Reason::kVariantUnknown);
  }
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutIndex, SceneVariants, ::testing::Bool(),
                         [](const auto& with) { return with.param ? "Index" : "NoIndex"; });

// A database of both variants that the sound presets can be served with, by cameras somewhere.
absl::StatusOr<std::shared_ptr<const ServedDatabase>> SoundDatabase(
    const std::filesystem::path& folder,
    const std::string& ball =
        "<collision><geometry><sphere radius=\"0.1\"/></geometry></collision>") {
  MakeDatabase(folder / "db");
  AddTools(folder / "db");
  const char* joint =
      R"(<joint name="$0" type="prismatic"><parent link="$1"/><child link="$0_end"/>
         <axis xyz="1 0 0"/><limit lower="-4" upper="4" effort="1" velocity="1"/></joint>
         <link name="$0_end">$2</link>)";
  std::ofstream(folder / "robot.urdf") << R"(<robot name="robot"><link name="base"/>)"
                                       << absl::Substitute(joint, "lift", "base", ball)
                                       << absl::Substitute(joint, "a", "lift_end", ball)
                                       << absl::Substitute(joint, "b", "a_end", ball) << "</robot>";
  auto robot = RobotModel::FromUrdf(folder / "robot.urdf");
  EXPECT_TRUE(robot.ok()) << robot.status();
  Calibration calibration;
  for (const MaskSize& size : kViewSizes) {
    const double x = 5.0 + static_cast<double>(calibration.cameras.size());
    calibration.cameras.push_back(
        testing::LookingAt({x, 0, 0}, {0, 0, 0}, {size.width * kScale, size.height * kScale}, 0.6));
  }
  const SoundCell sound{
      .settings = {.least_obstacle = 0.3, .voxel_edge = 0.2, .whole_model = true},
      .workspace = Eigen::AlignedBox3d(Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1)),
      .payload_radius = 0.1,
      .robot = std::make_shared<const RobotModel>(*std::move(robot))};
  const auto database = Database::Open(folder / "db", Database::Access::kRead);
  EXPECT_TRUE(database.ok()) << database.status();
  return ServedDatabase::Load(**database, {}, {}, sound, LoadSettings{.calibration = calibration});
}

// As far as its model goes, it would touch nothing.
TEST(SoundVariants, RobotWithoutGeometryIsRefused) {
  EXPECT_THAT(std::string(SoundDatabase(FreshFolder(), "").status().message()),
              HasSubstr("has no visual or collision geometry"));
}

// Links that stand as in the scene touch nothing, as they do now - unless they carry something
// else.
TEST(SoundVariants, WhatStandsAsInTheSceneMayTouchWithAnotherVariant) {
  const std::filesystem::path folder = FreshFolder();
  const auto made = SoundDatabase(folder);
  ASSERT_TRUE(made.ok()) << made.status();
  const auto& both = *made;
  for (const std::string scene_variant : {"default", kTool}) {
    SceneInput input = scene_variant == kTool ? ToolScene(0, 0, 4) : EmptyCellScene();
    const auto scene = SceneVariantsSceneOf(*both, input);
    for (const std::string variant : {"default", kTool}) {
      const Served served = ServedWith(both, scene, variant);
      const TestSupport support = SupportFor(served, {.preset = Preset::kSound});
      EXPECT_EQ(support.robot_may_touch != nullptr, variant == scene_variant)
          << scene_variant << ", " << variant;
      EXPECT_EQ(&support.possible_space->space(), &served.database->sound()->space())
          << "where that variant's robot reaches";
    }
  }
}

// What memory holds or not makes no difference.
TEST(SceneVariantsInPlace, AnswerAsInMemory) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.index = true});
  AddTools(folder / "db");
  const auto held = LoadDatabase(folder / "db", {.margin = 0}, {}, {.variants_in_memory = true});
  ASSERT_TRUE(held->Variant(kTool)->robot_images().in_memory());
  const auto in_place = LoadDatabase(folder / "db", {.margin = 0}, {}, {.robot_image_memory = 0});
  ASSERT_FALSE(in_place->robot_images().in_memory());
  ASSERT_FALSE(in_place->Variant(kTool)->robot_images().in_memory());
  std::mt19937_64 random(1);
  for (int block = 0; block < 5; ++block) {
    const SceneInput input = ToolScene(0, 3, block);
    ExpectSame(ServedWith(held, SceneVariantsSceneOf(*held, input), ""),
               ServedWith(in_place, SceneVariantsSceneOf(*in_place, input), ""), {}, random);
  }
}

TEST(SceneVariantsInPlace, OtherVariantsCostNoMemoryUnlessTheyMay) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db");
  AddTools(folder / "db");
  const auto usual = LoadDatabase(folder / "db");
  EXPECT_TRUE(usual->robot_images().in_memory());
  EXPECT_FALSE(usual->Variant(kTool)->robot_images().in_memory());
  // What the default variant leaves is not enough.
  const uint64_t one_variant = 40 * usual->robot_images().words() * sizeof(uint64_t);
  const auto no_room =
      LoadDatabase(folder / "db", {.margin = 0}, {},
                   {.robot_image_memory = 2 * one_variant - 1, .variants_in_memory = true});
  EXPECT_TRUE(no_room->robot_images().in_memory());
  EXPECT_FALSE(no_room->Variant(kTool)->robot_images().in_memory());
}

// A record of the default variant gets lost: what rests on it is corrupt in the other variant,
// never free.
TEST(SceneVariantsDamaged, ALostBaseIsNeverFree) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db");
  AddTools(folder / "db");
  {
    // The same image in both variants is stored once.
    const auto database = Database::Open(folder / "db", Database::Access::kWrite);
    const auto variant = (*database)->OpenVariant(kTool);
    auto writer = (*variant)->Write("test");
    ASSERT_TRUE(writer->Put(TestRobotImage((*variant)->grid(), 2, 3), /*replace=*/true).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  const auto before = LoadDatabase(folder / "db");
  ASSERT_EQ(before->Variant(kTool)->robot_images().state(before->grid().NumberOf({2, 3})),
            RobotImageState::kPresent);
  DamageRecord(folder / "db", TestRobotImage(before->grid(), 2, 3));
  const auto database = LoadDatabase(folder / "db");
  const ConfigurationNumber number = database->grid().NumberOf({2, 3});
  EXPECT_EQ(database->robot_images().state(number), RobotImageState::kCorrupt);
  EXPECT_EQ(database->Variant(kTool)->robot_images().state(number), RobotImageState::kCorrupt);
  const Served served =
      ServedWith(database, SceneVariantsSceneOf(*database, ToolScene(0, 0, 4)), "");
  EXPECT_EQ(Checker(served, {}, {}, kSceneVariantsNow).Check(At(2, 3)).reason(),
            Reason::kRobotImageCorrupt);
}

}  // namespace
}  // namespace silhouette
