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

// The image of grid point (2, 7) is suspect, that of (3, 7) captured right after the span.
std::string MakeSuspectDatabase() {
  const std::string path = FreshFolder() / "db";
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
    storage::v1::CaptureHistory history;
    storage::v1::SuspectSpan& span = *history.add_suspects();
    span.mutable_after()->set_seconds(100);
    span.mutable_until()->set_seconds(200);
    EXPECT_TRUE((*database)->SetCaptureHistory(history).ok());
  }
  BuildIndex(path);
  return path;
}

struct SuspectImagesTest : ::testing::TestWithParam<bool> {
  std::shared_ptr<const ServedDatabase> database =
      LoadDatabase(MakeSuspectDatabase(), {.margin = 0}, {},
                   GetParam() ? LoadSettings{} : LoadSettings{.robot_image_memory = 0});

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
