// SPDX-License-Identifier: Apache-2.0
// Robot images that were captured while the cell may have changed.
#include <gmock/gmock.h>

#include "db/store/suspects.h"
#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Moment kSuspectImagesNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

// In place of the spans that there are.
void SetSuspectSpan(const std::string& path, int64_t after, int64_t until) {
  const auto database = Database::Open(path, Database::Access::kWrite);
  storage::v1::CaptureHistory history;
  storage::v1::SuspectSpan& span = *history.add_suspects();
  span.mutable_after()->set_seconds(after);
  span.mutable_until()->set_seconds(until);
  EXPECT_TRUE((*database)->SetCaptureHistory(history).ok());
}

// The image of grid point (2, 7) is suspect, that of (3, 7) captured right after the span.
std::string MakeSuspectDatabase(const std::string& path = FreshFolder() / "db") {
  MakeDatabase(path);
  {
    const auto database = Database::Open(path, Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    for (const int a : {2, 3}) {
      RobotImage image = TestRobotImage((*database)->grid(), a, 7);
      image.captured = absl::FromUnixSeconds(a == 2 ? 200 : 201);
      EXPECT_TRUE(writer->Put(image, /*replace=*/true).ok());
    }
    EXPECT_TRUE(writer->Commit().ok());
  }
  SetSuspectSpan(path, 100, 200);
  BuildIndex(path);
  return path;
}

struct SuspectImagesTest : ::testing::TestWithParam<bool> {
  const std::string path = MakeSuspectDatabase();
  std::shared_ptr<const ServedDatabase> database = LoadDatabase(
      path, {.margin = 0}, {}, GetParam() ? LoadSettings{} : LoadSettings{.robot_image_memory = 0});

  Checker CheckerOf(const SceneInput& input) const {
    absl::StatusOr<Scene> scene = MakeScene(*database, input, {}, {}, kSuspectImagesNow);
    EXPECT_TRUE(scene.ok()) << scene.status();
    scene->id = 1;
    return Checker({database, std::make_shared<const Scene>(*std::move(scene)), Reason::kNone}, {},
                   {}, kSuspectImagesNow);
  }
};

TEST_P(SuspectImagesTest, AreNeverFree) {
  const Checker checker = CheckerOf(EmptyCellScene());
  EXPECT_EQ(checker.Check(At(2, 7)), Verdict::Unknown(Reason::kRobotImageSuspect));
  EXPECT_TRUE(checker.Check(At(3, 7)).free());
  EXPECT_EQ(checker.CheckPath(std::vector<Configuration>{At(1, 7), At(3, 7)}).verdict.reason(),
            Reason::kRobotImageSuspect);
  EXPECT_EQ(database->robot_images().Count(RobotImageState::kSuspect), 1u);
  const ConfigurationNumber number = database->grid().NumberOf({2, 7});
  const TileVerdicts tile = CheckAllTiles(checker.served(), {})[number / kTileSize];
  const uint64_t place = number % kTileSize;
  EXPECT_EQ(tile.free[place / 64] >> (place % 64) & 1, 0u);
}

TEST_P(SuspectImagesTest, TellNothingOfASceneInWhichTheRobotIsThere) {
  const Checker checker = CheckerOf(EmptyCellScene(2, 7));
  EXPECT_EQ(checker.blocked(), Reason::kRobotImageOfSceneMissing);
  EXPECT_THAT(checker.served().scene->defects,
              ElementsAre(::testing::Field(&SceneDefect::message,
                                           HasSubstr("while the cell may have changed"))));
}

TEST_P(SuspectImagesTest, AreNoticedWhenASessionChangesThem) {
  EXPECT_FALSE(*database->SuspectsChanged());
  SetSuspectSpan(path, 100, 201);
  EXPECT_TRUE(*database->SuspectsChanged()) << "more";
  SetSuspectSpan(path, 300, 400);
  EXPECT_TRUE(*database->SuspectsChanged()) << "none";
  SetSuspectSpan(path, 100, 200);
  EXPECT_FALSE(*database->SuspectsChanged()) << "the same";
}

TEST(SuspectImages, AreNoticedInEveryVariantAndOnlyIfTheyAreLoaded) {
  const std::string path = FreshFolder() / "db";
  MakeDatabase(path);
  const auto whole = Database::Open(path, Database::Access::kWrite);
  const auto closed = (*whole)->CreateVariant("closed", "test");
  auto writer = (*closed)->Write("test");
  RobotImage image = TestRobotImage((*closed)->grid(), 2, 7);
  image.captured = absl::FromUnixSeconds(200);
  EXPECT_TRUE(writer->Put(image).ok());
  EXPECT_TRUE(writer->Commit().ok());
  const auto served = LoadDatabase(path);
  storage::v1::CaptureHistory history;
  storage::v1::SuspectSpan& span = *history.add_suspects();
  span.mutable_after()->set_seconds(200);
  span.mutable_until()->set_seconds(300);
  EXPECT_TRUE((*closed)->SetCaptureHistory(history).ok());
  EXPECT_FALSE(*served->SuspectsChanged()) << "captured after what is loaded";
  span.mutable_after()->set_seconds(199);
  EXPECT_TRUE((*closed)->SetCaptureHistory(history).ok());
  EXPECT_TRUE(*served->SuspectsChanged());
}

TEST(SuspectSpans, FromTheBeginningHoldImagesWithoutATime) {
  storage::v1::CaptureHistory history;
  storage::v1::SuspectSpan& span = *history.add_suspects();
  span.mutable_after()->set_seconds(0);
  span.mutable_until()->set_seconds(200);
  const SuspectSpans spans(history);
  EXPECT_TRUE(spans.Contain(RobotImage().captured));
  EXPECT_TRUE(spans.Contain(absl::FromUnixSeconds(200)));
  EXPECT_FALSE(spans.Contain(absl::FromUnixSeconds(201)));
}

INSTANTIATE_TEST_SUITE_P(InMemoryAndInPlace, SuspectImagesTest, ::testing::Bool());

}  // namespace
}  // namespace silhouette
