// SPDX-License-Identifier: Apache-2.0
#include "server/scene/served_database.h"

#include <gmock/gmock.h>

#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

RobotImageState StateAt(const ServedDatabase& database, int a, int b) {
  return database.robot_images().state(database.grid().NumberOf({a, b}));
}

TEST(ServedDatabase, HoldsTheRobotImagesOfTheStore) {
  const auto database = NewDatabase();
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      for (int view = 0; view < 3; ++view) {
        EXPECT_EQ((*database->robot_images().Images(database->grid().NumberOf({a, b})))[view],
                  RobotMask(view, a, b));
      }
    }
  }
  EXPECT_GT(database->generation(), 0u);
  EXPECT_EQ(database->ViewOf("top"), 2);
  EXPECT_EQ(database->ViewOf("bottom"), std::nullopt);
  EXPECT_FALSE(database->has_references());
}

TEST(ServedDatabase, MarksWhatIsMissingExcludedOrFailsItsChecksum) {
  const auto database =
      NewDatabase({.missing = {{0, 7}}, .excluded = {{4, 7}}, .corrupt = {{2, 7}}});
  EXPECT_EQ(StateAt(*database, 0, 7), RobotImageState::kMissing);
  EXPECT_EQ(StateAt(*database, 4, 7), RobotImageState::kExcluded);
  EXPECT_EQ(StateAt(*database, 2, 7), RobotImageState::kCorrupt);
  EXPECT_EQ(StateAt(*database, 1, 7), RobotImageState::kPresent);
  EXPECT_EQ(database->robot_images().Count(RobotImageState::kPresent), 37u);
}

void ExpectViewsWithoutTheRobotAreNotServed(const std::vector<size_t>& views) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db");
  {
    const auto database = Database::Open(folder / "db", Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) {
        RobotImage image = TestRobotImage((*database)->grid(), a, b);
        for (const size_t view : views) image.masks[view] = Mask(image.masks[view].size());
        ASSERT_TRUE(writer->Put(image, /*replace=*/true).ok());
      }
    }
    ASSERT_TRUE(writer->Commit().ok());
  }
  const auto database = Database::Open(folder / "db", Database::Access::kRead);
  const absl::Status status = ServedDatabase::Load(**database).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_THAT(status.message(), HasSubstr("shows no robot in any of 40 robot images"));
}

TEST(ServedDatabase, ViewThatNeverShowsTheRobotIsNotServed) {
  ExpectViewsWithoutTheRobotAreNotServed({1});
}

TEST(ServedDatabase, RobotImagesThatAreAllEmptyAreNotServed) {
  ExpectViewsWithoutTheRobotAreNotServed({0, 1, 2});
}

// No view shows the robot at grid point (2, 7), a single one at (3, 7).
std::string DatabaseWithAnEmptyRobotImage() {
  const std::string path = FreshFolder() / "db";
  MakeDatabase(path);
  {
    const auto database = Database::Open(path, Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    for (const int a : {2, 3}) {
      RobotImage image = TestRobotImage((*database)->grid(), a, 7);
      for (size_t view = 0; view < image.masks.size(); ++view) {
        if (a == 2 || view > 0) image.masks[view] = Mask(image.masks[view].size());
      }
      EXPECT_TRUE(writer->Put(image, /*replace=*/true).ok());
    }
    EXPECT_TRUE(writer->Commit().ok());
  }
  BuildIndex(path);
  return path;
}

Checker CheckerIn(const std::shared_ptr<const ServedDatabase>& database, const SceneInput& input) {
  const Moment now{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};
  absl::StatusOr<Scene> scene = MakeScene(*database, input, {}, {}, now);
  EXPECT_TRUE(scene.ok()) << scene.status();
  scene->id = 1;
  return Checker({database, std::make_shared<const Scene>(*std::move(scene)), Reason::kNone}, {},
                 {}, now);
}

TEST(ServedDatabase, RobotImageWithoutAPixelInAnyViewIsNeverFree) {
  const std::string path = DatabaseWithAnEmptyRobotImage();
  for (const LoadSettings& settings : {LoadSettings{}, LoadSettings{.robot_image_memory = 0}}) {
    const auto database = LoadDatabase(path, {.margin = 0}, {}, settings);
    EXPECT_EQ(StateAt(*database, 2, 7), RobotImageState::kEmpty);
    EXPECT_EQ(StateAt(*database, 3, 7), RobotImageState::kPresent);
    const Checker checker = CheckerIn(database, EmptyCellScene());
    EXPECT_EQ(checker.Check(At(2, 7)), Verdict::Unknown(Reason::kRobotImageCorrupt));
    EXPECT_TRUE(checker.Check(At(3, 7)).free());
    const std::vector<Configuration> way = {At(1, 7), At(3, 7)};
    EXPECT_EQ(checker.CheckPath(way).verdict.reason(), Reason::kRobotImageCorrupt);
    const ConfigurationNumber number = database->grid().NumberOf({2, 7});
    const TileVerdicts tile = CheckAllTiles(checker.served(), {})[number / kTileSize];
    const uint64_t place = number % kTileSize;
    EXPECT_EQ(tile.free[place / 64] >> (place % 64) & 1, 0u);
  }
}

TEST(ServedDatabase, RobotThatNoViewShowsLeavesTheSceneUsable) {
  const std::string path = DatabaseWithAnEmptyRobotImage();
  LoadSettings forbidding;
  forbidding.forbidden = JointRegions(
      {{RegionRange{.joint = 0, .lower = 2, .upper = 2},
        RegionRange{.joint = 1, .lower = At(2, 7)[1] - 0.1, .upper = At(2, 7)[1] + 0.1}}});
  for (const LoadSettings& settings :
       {LoadSettings{}, LoadSettings{.robot_image_memory = 0}, forbidding}) {
    const auto database = LoadDatabase(path, {.margin = 0}, {}, settings);
    const bool forbidden = !settings.forbidden.empty();
    EXPECT_EQ(database->robot_images().Count(RobotImageState::kEmpty), forbidden ? 0u : 1u);
    SceneInput unseen = EmptyCellScene();
    unseen.joints = JointsAt(At(2, 7));
    for (int view = 0; view < 3; ++view) {
      unseen.views[static_cast<size_t>(view)].image = SceneMask{Mask(kViewSizes[view])};
    }
    SceneInput beside = EmptyCellScene(1, 7);
    beside.joints = JointsAt({1.1, At(1, 7)[1]});
    for (const SceneInput& input : {unseen, beside}) {
      const Checker checker = CheckerIn(database, input);
      EXPECT_EQ(checker.blocked(), Reason::kNone);
      EXPECT_TRUE(checker.Check(At(0, 0)).free());
      EXPECT_EQ(checker.Check(At(2, 7)),
                Verdict::Unknown(forbidden ? Reason::kExcluded : Reason::kRobotImageCorrupt));
    }
  }
}

TEST(ServedDatabase, IsNotTouchedByWhatIsWrittenAfterwards) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.missing = {{0, 7}}});
  const auto before = LoadDatabase(folder / "db");
  {
    const auto database = Database::Open(folder / "db", Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    ASSERT_TRUE(writer->Put(TestRobotImage((*database)->grid(), 0, 7)).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  const auto after = LoadDatabase(folder / "db");
  EXPECT_EQ(StateAt(*before, 0, 7), RobotImageState::kMissing);
  EXPECT_EQ(StateAt(*after, 0, 7), RobotImageState::kPresent);
  EXPECT_NE(before->generation(), after->generation());
}

TEST(ServedDatabase, DecodesTheReferenceImages) {
  const auto database = NewDatabase({.references = true});
  ASSERT_TRUE(database->has_references());
  EXPECT_EQ(database->reference(2).size(), cv::Size(40, 40));
}

TEST(ServedDatabase, ReferenceThatCannotBeDecodedIsDataLoss) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db");
  storage::v1::References references = TestReferences();
  references.mutable_views(1)->set_noise_png("no image");
  const auto database = Database::Open(folder / "db", Database::Access::kWrite);
  ASSERT_TRUE((*database)->SetReferences(references, "test").ok());
  const auto served = ServedDatabase::Load(**database);
  ASSERT_TRUE(absl::IsDataLoss(served.status())) << served.status();
  EXPECT_THAT(served.status().message(), HasSubstr("view 'right'"));
}

TEST(ServedDatabase, HasTheCalibrationOfItsGeneration) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db");
  const auto without = LoadDatabase(folder / "db");
  EXPECT_EQ(without->calibration(), nullptr);
  EXPECT_EQ(without->bands(), nullptr);
  EXPECT_EQ(without->BestPreset(), Preset::kUncalibrated);
  {
    const auto database = Database::Open(folder / "db", Database::Access::kWrite);
    ASSERT_TRUE((*database)->SetCalibration(TestCalibration(), "test").ok());
  }
  const auto with = LoadDatabase(folder / "db");
  EXPECT_GT(with->generation(), without->generation());
  ASSERT_NE(with->bands(), nullptr);
  EXPECT_EQ(with->calibration()->fundamental_matrices.size(), 3u);
  EXPECT_EQ(with->BestPreset(), Preset::kUncalibrated);
  // Rows 3 of the first two views are one line, rows 3 and 1 of the first and the third.
  EXPECT_TRUE(with->bands()->Meet(0, 3 * 16, 1, 3 * 16 + 7));
  EXPECT_FALSE(with->bands()->Meet(0, 3 * 16, 1, 4 * 16));
  EXPECT_TRUE(with->bands()->Meet(0, 3 * 16, 2, 10));
  EXPECT_TRUE(LoadDatabase(folder / "db", {.margin = 0.25})->bands()->Meet(0, 3 * 16, 1, 4 * 16));
}

TEST(ServedDatabase, ServesOnlyPoliciesThatItHasWhatItTakesFor) {
  const auto without = NewDatabase();
  const auto with = NewDatabase({.calibration = TestCalibration()});
  for (const Preset preset : {Preset::kUncalibrated, Preset::kPaper}) {
    EXPECT_TRUE(without->CanServe({.preset = preset}).ok());
    EXPECT_TRUE(with->CanServe({.preset = preset}).ok());
  }
  for (const Preset preset : {Preset::kCalibrated, Preset::kPaperCalibrated}) {
    const absl::Status status = without->CanServe({.preset = preset});
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_NE(status.message().find(NameOf(preset) + "' needs a calibration"), std::string::npos);
    EXPECT_TRUE(with->CanServe({.preset = preset}).ok());
  }
}

TEST(ServedDatabase, WithACalibrationThatIsNoneIsNotServed) {
  const std::filesystem::path folder = FreshFolder();
  storage::v1::Calibration singular = TestCalibration();
  singular.mutable_fundamental_matrices(1)->mutable_f()->Set(7, 0);
  singular.mutable_fundamental_matrices(1)->mutable_f()->Set(8, 0);  // rank 1
  MakeDatabase(folder / "db", {.calibration = singular});
  const auto database = Database::Open(folder / "db", Database::Access::kRead);
  const absl::Status status = ServedDatabase::Load(**database).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(status.message().find("rank 2"), std::string::npos) << status;
}

TEST(ServedDatabase, TakesNoNegativeMargin) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.calibration = TestCalibration()});
  const auto database = Database::Open(folder / "db", Database::Access::kRead);
  EXPECT_EQ(ServedDatabase::Load(**database, {.margin = -1}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace silhouette
