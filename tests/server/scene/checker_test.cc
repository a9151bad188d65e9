// SPDX-License-Identifier: Apache-2.0
// The verdicts of one request; every case of "never free" that scenes and time can bring about.
#include "server/scene/checker.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <stdexcept>

#include "server/scene/configuration_space.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

const Moment kCheckerNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

Moment CheckerAfter(absl::Duration duration) {
  return {kCheckerNow.time + duration, kCheckerNow.running + duration};
}

struct CheckerTest : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database =
      NewDatabase({.missing = {{0, 7}}, .excluded = {{4, 7}}, .corrupt = {{2, 7}}});
  SceneSettings settings;

  Served ServedScene(const SceneInput& input, uint64_t id = 1) const {
    absl::StatusOr<Scene> scene = MakeScene(*database, input, settings, {}, kCheckerNow);
    EXPECT_TRUE(scene.ok()) << scene.status();
    scene->id = id;
    return {database, std::make_shared<const Scene>(*std::move(scene)), Reason::kNone};
  }
  Checker CheckerOf(const SceneInput& input, const Moment& now = kCheckerNow,
                    const Policy& policy = {}) const {
    return Checker(ServedScene(input), policy, settings, now);
  }

  // Nothing at all is free: no configuration of the grid, none between, no path, no tile.
  static void ExpectNothingFree(const Checker& checker, Reason reason) {
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) {
        EXPECT_EQ(checker.Check(At(a, b)), Verdict::Unknown(reason));
      }
    }
    EXPECT_EQ(checker.Check(Configuration{0.5, 0.1}), Verdict::Unknown(reason));
    EXPECT_EQ(checker.CheckPath(std::vector<Configuration>{At(0, 0), At(0, 1)}).verdict,
              Verdict::Unknown(reason));
    EXPECT_EQ(checker.blocked(), reason);
  }
};

TEST_F(CheckerTest, GoodSceneGivesFreeAndOccupied) {
  const Checker checker = CheckerOf(SceneWithBlock(3));
  EXPECT_TRUE(checker.Check(At(1, 0)).free());
  EXPECT_EQ(checker.Check(At(3, 0)).state(), State::kOccupied);
  std::vector<ViewEvidence> evidence(3);
  checker.Check(At(3, 0), evidence);
  EXPECT_EQ(evidence[0].obstacle_pixels, (Block(0, 3) & RobotMask(0, 3, 0)).Count());
  EXPECT_FALSE(checker.CheckPath(std::vector<Configuration>{At(1, 0), At(4, 0)}).verdict.free());
  EXPECT_TRUE(checker.CheckPath(std::vector<Configuration>{At(0, 0), At(1, 0)}).verdict.free());
}

TEST_F(CheckerTest, RegionForbiddenAfterTheCaptureIsNeverFree) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.index = true});
  for (const uint64_t memory : {uint64_t{1} << 30, uint64_t{0}}) {
    LoadSettings load{.robot_image_memory = memory};
    load.forbidden = JointRegions(
        {{{.joint = 0, .lower = 1.4, .upper = 1.6}}, {{.joint = 0, .lower = 3, .upper = 3}}});
    database = LoadDatabase(folder / "db", {.margin = 0}, {}, load);
    const Served served = ServedScene(EmptyCellScene());
    const Checker checker(served, {}, settings, kCheckerNow);
    for (const double a : {1.5, 3.0}) {
      EXPECT_EQ(checker.Check(Configuration{a, 0}), Verdict::Unknown(Reason::kExcluded));
    }
    EXPECT_EQ(checker.CheckPath(std::vector<Configuration>{At(1, 0), At(2, 0)}).verdict,
              Verdict::Unknown(Reason::kExcluded));
    for (const int a : {0, 1, 2, 4}) EXPECT_TRUE(checker.Check(At(a, 0)).free()) << a;
    const ConfigurationSpace space(served, {});
    const auto state = [&](int a) { return space.state(database->grid().NumberOf({a, 0})); };
    EXPECT_EQ(state(0), State::kFree);
    for (const int a : {1, 2, 3}) EXPECT_EQ(state(a), State::kUnknown) << a;
    EXPECT_EQ(state(4), State::kFree);
  }
}

TEST_F(CheckerTest, RobotBesideARegionForbiddenAfterTheCaptureLeavesTheSceneUsable) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.index = true});
  for (const uint64_t memory : {uint64_t{1} << 30, uint64_t{0}}) {
    LoadSettings load{.robot_image_memory = memory};
    load.forbidden = JointRegions({{{.joint = 0, .lower = 3, .upper = 4}}});
    database = LoadDatabase(folder / "db", {.margin = 0}, {}, load);
    SceneInput input = EmptyCellScene(2, 0);
    input.joints = JointsAt({2.9, At(2, 0)[1]});  // the cell's corners at 3 are forbidden
    const Checker checker = CheckerOf(input);
    EXPECT_EQ(checker.blocked(), Reason::kNone);
    for (const double a : {0.0, 2.0, 2.9}) {
      EXPECT_TRUE(checker.Check(Configuration{a, 0}).free()) << a;
    }
    for (const double a : {3.0, 3.5, 4.0}) {
      EXPECT_EQ(checker.Check(Configuration{a, 0}), Verdict::Unknown(Reason::kExcluded)) << a;
    }
  }
}

TEST_F(CheckerTest, NoSceneYetIsNeverFree) {
  const Checker checker({database, nullptr, Reason::kNoScene}, {}, settings, kCheckerNow);
  ExpectNothingFree(checker, Reason::kNoScene);
  EXPECT_EQ(checker.TestRobotImages(At(0, 0)), std::nullopt);
}

TEST_F(CheckerTest, SceneOlderThanMaxAgeIsNeverFree) {
  settings.max_age = absl::Seconds(2);
  EXPECT_TRUE(CheckerOf(EmptyCellScene(), CheckerAfter(absl::Seconds(2))).Check(At(1, 0)).free());
  ExpectNothingFree(CheckerOf(EmptyCellScene(), CheckerAfter(absl::Milliseconds(2001))),
                    Reason::kSceneStale);
}

TEST_F(CheckerTest, SceneThatArrivedOldIsNeverFree) {
  SceneInput input = EmptyCellScene();
  for (ViewInput& view : input.views)
    view.captured = MomentOf(kCheckerNow.time - absl::Seconds(3), kCheckerNow);
  const Checker checker = CheckerOf(input);
  EXPECT_EQ(checker.served().scene->AgeAt(kCheckerNow), absl::Seconds(3));
  ExpectNothingFree(checker, Reason::kSceneStale);
}

TEST_F(CheckerTest, WallClockThatStepsBackMakesNoSceneYoung) {
  const Moment now{kCheckerNow.time - absl::Hours(1), kCheckerNow.running + absl::Seconds(5)};
  ExpectNothingFree(CheckerOf(EmptyCellScene(), now), Reason::kSceneStale);
}

TEST_F(CheckerTest, ViewsFurtherApartThanMaxSkewAreNeverFree) {
  SceneInput input = EmptyCellScene();
  input.views[0].captured = MomentOf(kCheckerNow.time - absl::Milliseconds(60), kCheckerNow);
  ExpectNothingFree(CheckerOf(input), Reason::kSceneSkewed);
}

TEST_F(CheckerTest, ViewMissingFromTheSceneIsNeverFree) {
  SceneInput input = SceneWithBlock(3);
  input.views.erase(input.views.begin());
  for (int occluded = 0; occluded < 3; ++occluded) {
    const Policy policy{.max_occluded_views = occluded};
    const Checker checker = CheckerOf(input, kCheckerNow, policy);
    for (int a = 0; a < 5; ++a) EXPECT_FALSE(checker.Check(At(a, 0)).free());
    EXPECT_EQ(checker.Check(At(3, 0)).state(), State::kOccupied);
    if (occluded < 2) {
      EXPECT_EQ(checker.Check(At(1, 0)), Verdict::Unknown(Reason::kViewMissing, true));
    }
    for (const TileVerdicts& tile : CheckAllTiles(checker.served(), policy)) {
      for (uint64_t word : tile.free) EXPECT_EQ(word, 0u);
    }
  }
}

TEST_F(CheckerTest, RobotPositionNotToldIsNeverFree) {
  SceneInput input = EmptyCellScene();
  input.joints = {{"lift", 0.5}};
  ExpectNothingFree(CheckerOf(input), Reason::kRobotPositionUnknown);
}

TEST_F(CheckerTest, RobotOutsideTheGridIsNeverFree) {
  SceneInput input = EmptyCellScene();
  input.joints[0].position = -0.1;
  ExpectNothingFree(CheckerOf(input), Reason::kRobotPositionUnknown);
}

TEST_F(CheckerTest, FixedJointNotWhereItStoodAtCaptureIsNeverFree) {
  SceneInput input = EmptyCellScene();
  input.joints[2].position = 0.6;
  ExpectNothingFree(CheckerOf(input), Reason::kFixedJointMoved);
}

TEST_F(CheckerTest, RobotWhereNoUsableRobotImageIsIsNeverFree) {
  for (int a : {0, 2, 4}) {
    ExpectNothingFree(CheckerOf(EmptyCellScene(a, 7)), Reason::kRobotImageOfSceneMissing);
  }
}

TEST_F(CheckerTest, TooLargeAnAreaOfCoreErrorsIsNeverFree) {
  SceneInput input = EmptyCellScene();
  for (int view = 0; view < 3; ++view) input.views[view].image = SceneMask{Mask(kViewSizes[view])};
  settings.max_core_error = 0;
  ExpectNothingFree(CheckerOf(input), Reason::kErrorArea);
}

TEST_F(CheckerTest, SceneOfAnotherGenerationIsNeverFree) {
  Served served = ServedScene(EmptyCellScene());
  Scene scene = *served.scene;
  ++scene.generation;
  served.scene = std::make_shared<const Scene>(scene);
  ExpectNothingFree(Checker(served, {}, settings, kCheckerNow), Reason::kGenerationMismatch);
  ExpectNothingFree(
      Checker({database, nullptr, Reason::kGenerationMismatch}, {}, settings, kCheckerNow),
      Reason::kGenerationMismatch);
}

TEST_F(CheckerTest, ConfigurationOutsideTheGridIsNeverFree) {
  const Checker checker = CheckerOf(EmptyCellScene());
  EXPECT_EQ(checker.Check(Configuration{4.1, 0}), Verdict::Unknown(Reason::kOutsideGrid));
}

TEST_F(CheckerTest, ConfigurationWithoutUsableRobotImageIsNeverFree) {
  const Checker checker = CheckerOf(EmptyCellScene());
  EXPECT_EQ(checker.Check(At(0, 7)), Verdict::Unknown(Reason::kRobotImageMissing));
  EXPECT_EQ(checker.Check(At(4, 7)), Verdict::Unknown(Reason::kExcluded));
  EXPECT_EQ(checker.Check(At(2, 7)), Verdict::Unknown(Reason::kRobotImageCorrupt));
  EXPECT_FALSE(checker.CheckPath(std::vector<Configuration>{At(0, 6), At(0, 8)}).verdict.free());
}

TEST_F(CheckerTest, AllTilesAgreeWithSingleChecks) {
  const Checker checker = CheckerOf(SceneWithBlock(3));
  const std::vector<TileVerdicts> tiles = CheckAllTiles(checker.served(), {});
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      const ConfigurationNumber number = database->grid().NumberOf({a, b});
      const TileVerdicts& tile = tiles[number / kTileSize];
      const uint64_t place = number % kTileSize;
      const State state = checker.Check(At(a, b)).state();
      EXPECT_EQ((tile.free[place / 64] >> (place % 64)) & 1, state == State::kFree);
      EXPECT_EQ((tile.occupied[place / 64] >> (place % 64)) & 1, state == State::kOccupied);
    }
  }
}

// The same verdicts with the collision index as without, also of what was damaged afterwards.
TEST_F(CheckerTest, TilesByTheIndexAreTheSameAsWithoutIt) {
  TestDatabase test{.missing = {{0, 7}}, .excluded = {{4, 7}}, .corrupt = {{2, 7}}};
  test.calibration = TestCalibration();
  const auto without = NewDatabase(test);
  test.index = true;
  const auto with = NewDatabase(test);
  ASSERT_EQ(without->index(), nullptr);
  ASSERT_NE(with->index(), nullptr);
  ASSERT_NE(with->index()->Tile(0), nullptr);
  for (const Preset preset : AllPresets()) {
    if (IsSound(preset)) continue;
    for (const SceneInput& input : {SceneWithBlock(3), SceneWithBlock(1), EmptyCellScene()}) {
      const auto tiles_of = [&](const std::shared_ptr<const ServedDatabase>& served) {
        database = served;
        return CheckAllTiles(ServedScene(input), {.preset = preset});
      };
      EXPECT_EQ(tiles_of(with), tiles_of(without)) << NameOf(preset);
    }
  }
}

// A robot image that is replaced makes the index of its tile useless.
TEST_F(CheckerTest, IndexOlderThanTheRobotImagesIsNotUsed) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.index = true});
  {
    const auto writable = Database::Open(folder / "db", Database::Access::kWrite);
    auto writer = (*writable)->Write("test");
    RobotImage image = TestRobotImage((*writable)->grid(), 1, 0);
    image.masks = TestRobotImage((*writable)->grid(), 3, 0).masks;
    ASSERT_TRUE(writer->Put(image, /*replace=*/true).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  database = LoadDatabase(folder / "db");
  EXPECT_EQ(database->index(), nullptr);
  const ConfigurationSpace space(ServedScene(SceneWithBlock(3)), {});
  EXPECT_EQ(space.state(database->grid().NumberOf({1, 0})), State::kOccupied);
  EXPECT_EQ(space.state(database->grid().NumberOf({2, 0})), State::kFree);
}

TEST_F(CheckerTest, StatesOfManyAreTheStatesOfEach) {
  const ConfigurationSpace space(ServedScene(SceneWithBlock(3)), {});
  std::vector<uint32_t> numbers;
  for (uint32_t i = 0; i < 5000; i += 7) numbers.push_back(i * 7919 % 4200);
  numbers.push_back(std::numeric_limits<uint32_t>::max());
  std::vector<uint64_t> free((numbers.size() + 63) / 64), occupied(free.size());
  space.States(numbers, free, occupied);
  std::set<State> states;
  for (size_t i = 0; i < numbers.size(); ++i) {
    const State state = space.state(numbers[i]);
    states.insert(state);
    EXPECT_EQ(free[i / 64] >> (i % 64) & 1, state == State::kFree ? 1u : 0u);
    EXPECT_EQ(occupied[i / 64] >> (i % 64) & 1, state == State::kOccupied ? 1u : 0u);
  }
  EXPECT_EQ(states.size(), 3u);
  EXPECT_THROW(space.States(numbers, {free.data(), 1}, occupied), std::invalid_argument);
}

TEST_F(CheckerTest, AllTilesOfABlockedSceneAreUnknown) {
  SceneInput input = SceneWithBlock(3);
  input.joints[2].position = 0.6;
  for (const TileVerdicts& tile : CheckAllTiles(ServedScene(input), {})) {
    EXPECT_EQ(tile, TileVerdicts{});
  }
}

TEST_F(CheckerTest, PolicyThatCannotBeIsRefused) {
  EXPECT_THROW(CheckerOf(EmptyCellScene(), kCheckerNow, {.min_views = 4}), std::invalid_argument);
  EXPECT_THROW(
      Checker({database, nullptr, Reason::kNoScene}, {.min_views = 0}, settings, kCheckerNow),
      std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
