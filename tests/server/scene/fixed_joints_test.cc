// SPDX-License-Identifier: Apache-2.0
// Joints outside the grid: verdicts rest on where they stood when robot images were captured.
#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/random.h"
#include "tests/server/tool_variant.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Moment kFixedJointsNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

// Where "lift", which the cell has at 0.5, was when the image of grid point (a, b) was captured.
using LiftAt = std::function<double(int a, int b)>;

void PutImages(Database& database, const LiftAt& lift) {
  auto writer = database.Write("test");
  ASSERT_TRUE(writer.ok()) << writer.status();
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      RobotImage image = database.variant() == kTool ? ToolImage(database.grid(), a, b)
                                                     : TestRobotImage(database.grid(), a, b);
      image.commanded = {At(a, b)[0], At(a, b)[1], 0.5};
      image.measured = {At(a, b)[0], At(a, b)[1], lift(a, b)};
      ASSERT_TRUE(writer->Put(image, /*replace=*/true).ok());
    }
  }
  ASSERT_TRUE(writer->Commit().ok());
}

struct Variant {
  bool in_place;
  bool index;
};

struct FixedJointsTest : ::testing::TestWithParam<Variant> {
  const std::filesystem::path folder = FreshFolder();

  // The default variant, and if there is a second function the tool's.
  std::shared_ptr<const ServedDatabase> Make(const LiftAt& lift, const LiftAt& with_tool = {}) {
    const std::string path = folder / absl::StrCat("db", count_++);
    MakeDatabase(path);
    {
      const auto database = Database::Open(path, Database::Access::kWrite);
      EXPECT_TRUE(database.ok()) << database.status();
      PutImages(**database, lift);
      if (with_tool) {
        const auto variant = (*database)->CreateVariant(kTool, "test");
        EXPECT_TRUE(variant.ok()) << variant.status();
        PutImages(**variant, with_tool);
      }
    }
    if (GetParam().index) BuildIndex(path);
    LoadSettings load;
    if (GetParam().in_place) load.robot_image_memory = 0;
    return LoadDatabase(path, {.margin = 0}, {}, load);
  }

  static Scene SceneOf(const ServedDatabase& database, const SceneInput& input) {
    absl::StatusOr<Scene> scene = MakeScene(database, input, {}, {}, kFixedJointsNow);
    EXPECT_TRUE(scene.ok()) << scene.status();
    scene->id = 1;
    return *std::move(scene);
  }

  static Served ServedWith(const std::shared_ptr<const ServedDatabase>& database,
                           const SceneInput& input, const std::string& variant) {
    const Served served{database, std::make_shared<const Scene>(SceneOf(*database, input)),
                        Reason::kNone};
    const absl::StatusOr<Served> with_variant = WithVariant(served, variant);
    EXPECT_TRUE(with_variant.ok()) << with_variant.status();
    return *with_variant;
  }

 private:
  int count_ = 0;
};

SceneInput SceneWithLift(double lift) {
  SceneInput input = EmptyCellScene();
  input.joints[2].position = lift;
  return input;
}

std::vector<std::string> Told(const Scene& scene) {
  std::vector<std::string> told;
  for (const SceneDefect& defect : scene.defects) {
    EXPECT_EQ(defect.reason, Reason::kFixedJointMoved);
    told.push_back(defect.message);
  }
  return told;
}

TEST_P(FixedJointsTest, SceneIsComparedWithWhereTheJointsStoodAtCapture) {
  const auto database = Make([](int a, int) { return a == 3 ? 0.503 : 0.499; });
  EXPECT_THAT(database->elsewhere(), IsEmpty());
  for (const double lift : {0.4981, 0.5, 0.5039}) {
    EXPECT_THAT(Told(SceneOf(*database, SceneWithLift(lift))), IsEmpty()) << lift;
  }
  // Near enough to the cell file's value, but not to all robot images.
  for (const double lift : {0.4979, 0.5041}) {
    const Scene scene = SceneOf(*database, SceneWithLift(lift));
    EXPECT_THAT(
        Told(scene),
        ElementsAre(AllOf(HasSubstr(absl::StrCat("joint 'lift' is at ", lift)),
                          HasSubstr("captured with it at 0.499 to 0.503 (tolerance 0.005)"))));
    EXPECT_EQ(scene.Blocked(), Reason::kFixedJointMoved);
  }
}

TEST_P(FixedJointsTest, SceneWhereAllImagesStoodButNotTheCellIsNeverFree) {
  const auto database = Make([](int, int) { return 0.8; });
  EXPECT_EQ(database->elsewhere(), "joint 'lift' at 0.8 instead of 0.5");
  for (const double lift : {0.5, 0.8}) {
    const Checker checker(ServedWith(database, SceneWithLift(lift), ""), {}, {}, kFixedJointsNow);
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) {
        EXPECT_EQ(checker.Check(At(a, b)), Verdict::Unknown(Reason::kFixedJointMoved));
      }
    }
  }
}

TEST_P(FixedJointsTest, RobotImageOfTheSceneCapturedElsewhereIsNamedWithBothValues) {
  const auto database = Make([](int a, int b) { return a == 0 && b == 0 ? 0.52 : 0.5; });
  const Scene scene = SceneOf(*database, EmptyCellScene());
  EXPECT_THAT(Told(scene), ElementsAre(HasSubstr("joint 'lift' at 0.52 instead of 0.5")));
  EXPECT_EQ(scene.Blocked(), Reason::kFixedJointMoved);
}

TEST_P(FixedJointsTest, VariantCapturedElsewhereIsNeverFreeAndHarmsNoOther) {
  const auto database = Make([](int, int) { return 0.5; }, [](int, int) { return 0.9; });
  EXPECT_EQ(database->Variant(kTool)->elsewhere(), "joint 'lift' at 0.9 instead of 0.5");
  const Checker plain(ServedWith(database, EmptyCellScene(), ""), {}, {}, kFixedJointsNow);
  const Checker tool(ServedWith(database, EmptyCellScene(), kTool), {}, {}, kFixedJointsNow);
  SceneInput with_tool = ToolScene(0, 0, 3);
  const Checker tool_there(ServedWith(database, with_tool, ""), {}, {}, kFixedJointsNow);
  with_tool.joints[2].position = 0.9;
  const Checker lift_there(ServedWith(database, with_tool, ""), {}, {}, kFixedJointsNow);
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      EXPECT_TRUE(plain.Check(At(a, b)).free());
      for (const Checker* checker : {&tool, &tool_there, &lift_there}) {
        EXPECT_EQ(checker->Check(At(a, b)), Verdict::Unknown(Reason::kFixedJointMoved));
      }
    }
  }
}

TEST_P(FixedJointsTest, SceneMustFitTheRobotImagesOfAllVariants) {
  const auto database = Make([](int, int) { return 0.498; }, [](int, int) { return 0.504; });
  EXPECT_THAT(Told(SceneOf(*database, SceneWithLift(0.5))), IsEmpty());
  EXPECT_THAT(Told(SceneOf(*database, SceneWithLift(0.4985))),
              ElementsAre(HasSubstr("0.498 to 0.504")));
}

// Against a database without the images that were captured elsewhere.
TEST_P(FixedJointsTest, ImagesCapturedElsewhereAreAsGoodAsMissing) {
  Random random;
  for (int round = 0; round < 6; ++round) {
    std::vector<double> lift(40, 0.5);
    TestDatabase without{.index = GetParam().index};
    for (int i = 1; i < 40; ++i) {  // the scene's own is there
      const unsigned kind = random() % 8;
      if (kind == 0) lift[i] = std::numeric_limits<double>::quiet_NaN();
      if (kind == 1) lift[i] = 0.5 + (random() % 2 == 0 ? 0.0051 : -0.0051);
      if (kind == 2) lift[i] = 100;
      if (kind == 3) lift[i] = 0.5049;
      if (kind < 3) without.missing.emplace_back(i / 8, i % 8);
    }
    const auto database = Make([&](int a, int b) { return lift[a * 8 + b]; });
    const SceneInput input = SceneWithBlock(static_cast<int>(random() % 5));
    const Served served = ServedWith(database, input, "");
    const Served expected = ServedWith(NewDatabase(without), input, "");
    const Checker checker(served, {}, {}, kFixedJointsNow);
    const Checker reference(expected, {}, {}, kFixedJointsNow);
    const ConfigurationSpace map(served, {});
    const ConfigurationSpace reference_map(expected, {});
    EXPECT_EQ(database->robot_images().Count(RobotImageState::kElsewhere), without.missing.size());
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) {
        const Verdict verdict = checker.Check(At(a, b));
        EXPECT_EQ(verdict.state(), reference.Check(At(a, b)).state());
        if (verdict.state() == State::kUnknown) {
          EXPECT_EQ(verdict.reason(), Reason::kFixedJointMoved);
        }
        const Configuration between = {At(a, b)[0] * 0.9, At(a, b)[1] + 0.3};
        EXPECT_EQ(checker.Check(between).state(), reference.Check(between).state());
      }
    }
    for (ConfigurationNumber n = 0; n < database->grid().number_limit(); ++n) {
      ASSERT_EQ(map.state(n), reference_map.state(n)) << n;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, FixedJointsTest,
                         ::testing::Values(Variant{false, false}, Variant{false, true},
                                           Variant{true, true}),
                         [](const auto& test) {
                           return absl::StrCat(test.param.in_place ? "InPlace" : "InMemory",
                                               test.param.index ? "WithIndex" : "");
                         });

}  // namespace
}  // namespace silhouette
