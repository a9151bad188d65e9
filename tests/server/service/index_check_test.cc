// SPDX-License-Identifier: Apache-2.0
// A collision index that is damaged while it is served.
#include "server/service/index_check.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "db/store/schema.h"
#include "db/store/tile_value.h"
#include "server/scene/checker.h"
#include "tests/db/store/raw_values.h"
#include "tests/server/service/test_server.h"
#include "tests/server/tool_variant.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

class IndexCheckTest : public ::testing::Test {
 protected:
  void SetUp() override {
    MakeDatabase(path, {.index = true});
    settings.clock = clock.clock();
  }

  void Serve() {
    database = LoadDatabase(path, {.margin = 0}, {}, load);
    if (scenes == nullptr) {
      scenes = std::make_unique<SceneStore>(database);
      check = std::make_unique<IndexCheck>(settings, *scenes, spaces);
    } else {
      scenes->ReplaceDatabase(database);
    }
  }

  void Publish(const SceneInput& input = SceneWithBlock(3)) {
    clock.Advance(absl::Milliseconds(1));
    absl::StatusOr<Scene> scene = MakeScene(*database, input, {}, {}, clock.clock()());
    ASSERT_TRUE(scene.ok()) << scene.status();
    ASSERT_TRUE(scenes->Publish(*std::move(scene), database).ok());
  }

  Reason Blocked() {
    const Moment now = clock.clock()();
    return BlockedReason(scenes->Newest(now), settings.scene, now);
  }

  // Of the map, of configuration (a, 0).
  State InMap(int a) {
    return spaces.Get(*WithVariant(scenes->Newest(clock.clock()()), ""), {})
        ->state(database->grid().NumberOf({a, 0}));
  }
  // Of one that the block is in the way of.
  State OfTheBlock() { return InMap(3); }

  const std::string path = FreshFolder() / "db";
  LoadSettings load;
  TestClock clock;
  ServingSettings settings;
  std::shared_ptr<const ServedDatabase> database;
  std::unique_ptr<SceneStore> scenes;
  SpaceCache spaces;
  std::unique_ptr<IndexCheck> check;
};

TEST_F(IndexCheckTest, SoundIndexStaysServed) {
  Serve();
  ASSERT_NE(database->index(), nullptr);
  check->Look(absl::Seconds(1));  // no scene yet
  for (int i = 0; i < 20; ++i) {
    Publish(i % 2 == 0 ? EmptyCellScene() : SceneWithBlock(i % 5));
    check->Look(absl::Milliseconds(50));
    EXPECT_EQ(Blocked(), Reason::kNone);
  }
  EXPECT_GE(check->counts().bytes, 20 * database->index()->Bytes(0).size());
  EXPECT_EQ(check->counts().compared, 20u * 16);
}

TEST_F(IndexCheckTest, DamagedTileMakesAllUnknownUntilTheDatabaseIsLoadedAgain) {
  Serve();
  Publish();
  EXPECT_EQ(OfTheBlock(), State::kOccupied);
  ZeroIndex(**Database::Open(path, Database::Access::kRead));
  Publish();
  EXPECT_EQ(OfTheBlock(), State::kFree) << "what this is about";
  check->Look(absl::Milliseconds(50));
  EXPECT_EQ(Blocked(), Reason::kDatabaseDamaged);
  Publish();
  check->Look(absl::Milliseconds(50));
  EXPECT_EQ(Blocked(), Reason::kDatabaseDamaged) << "it stays";

  const std::shared_ptr<const ServedDatabase> old = database;
  Serve();
  EXPECT_TRUE(old->damage().found());
  for (int i = 0; i < 3; ++i) {
    Publish();
    check->Look(absl::Milliseconds(50));
    EXPECT_EQ(Blocked(), Reason::kNone);
    EXPECT_EQ(OfTheBlock(), State::kOccupied) << "without the damaged tile";
  }
}

TEST_F(IndexCheckTest, DamageOfOneVariantIsDamageOfAll) {
  AddTools(path);
  BuildIndex(path);
  Serve();
  Publish();
  check->Look(absl::Milliseconds(50));
  EXPECT_EQ(Blocked(), Reason::kNone);
  const auto whole = Database::Open(path, Database::Access::kRead);
  ZeroIndex(**(*whole)->OpenVariant(kTool));
  check->Look(absl::Milliseconds(50));
  EXPECT_EQ(Blocked(), Reason::kDatabaseDamaged);
}

// A tile that is sound in itself, but says that no robot image touches anything.
TEST_F(IndexCheckTest, MapThatDiffersFromTheRobotImagesMakesAllUnknown) {
  PutRaw(path, schema::kCollisionIndex, 0, 0, [](const std::string& value) {
    const std::vector<PixelTree> trees(kViewSizes.begin(), kViewSizes.end());
    TileIndexBuilder builder(trees);
    const ConfigurationGrid grid = *GridOf(ServerTestCell());
    const std::vector<Mask> empty(kViewSizes.begin(), kViewSizes.end());
    for (ConfigurationNumber number = 0; number < kTileSize; ++number) {
      if (!grid.Contains(number)) continue;
      builder.Add(number,
                  std::vector<MaskWords>{empty[0].words(), empty[1].words(), empty[2].words()});
    }
    return EncodeTileValue(0, *TileHeaderIn(value), builder.Finish(), 4096);
  });
  settings.index_check.samples = 40;
  Serve();
  Publish(EmptyCellScene());
  check->Look(absl::Milliseconds(50));
  EXPECT_EQ(Blocked(), Reason::kNone) << "in an empty cell both say free";
  Publish();
  EXPECT_EQ(OfTheBlock(), State::kFree);
  for (int i = 0; i < 20 && Blocked() == Reason::kNone; ++i) check->Look(absl::Milliseconds(50));
  EXPECT_EQ(Blocked(), Reason::kDatabaseDamaged);
}

// Of configuration (0, 0), the first of its tile, which random samples often are.
TEST_F(IndexCheckTest, RobotImageThatCanNoLongerBeReadMakesAllUnknown) {
  load.robot_image_memory = 0;
  Serve();
  Publish(SceneWithBlock(3, 3, 4, 7));
  DamageRecord(path, TestRobotImage(database->grid(), 0, 0));
  EXPECT_EQ(InMap(0), State::kFree) << "what this is about";
  for (int i = 0; i < 20 && Blocked() == Reason::kNone; ++i) check->Look(absl::Milliseconds(50));
  EXPECT_EQ(Blocked(), Reason::kDatabaseDamaged);
  EXPECT_THAT(database->damage().what(), HasSubstr("can no longer be read"));
}

TEST_F(IndexCheckTest, RobotImageThatCouldNotBeReadAtTheStartIsNoDifference) {
  load.robot_image_memory = 0;
  DamageRecord(path, TestRobotImage(*GridOf(ServerTestCell()), 0, 0));
  Serve();
  for (int i = 0; i < 20; ++i) {
    Publish(SceneWithBlock(3, 3, 4, 7));
    check->Look(absl::Milliseconds(50));
    ASSERT_EQ(Blocked(), Reason::kNone);
  }
  EXPECT_GT(check->counts().compared, 0u);
}

TEST_F(IndexCheckTest, ReadsNoMoreThanItsRate) {
  settings.index_check.rate = 1'000'000;
  Serve();
  const uint64_t tile = database->index()->Summary().bytes;
  for (int i = 0; i < 1000; ++i) check->Look(absl::Milliseconds(1));
  EXPECT_LE(check->counts().bytes, 1'000'000 + tile);
  EXPECT_GE(check->counts().bytes, 1'000'000 - tile);
  const uint64_t before = check->counts().bytes;
  check->Look(absl::Hours(1));  // the thread was held up
  EXPECT_EQ(check->counts().bytes, before + tile) << "once is enough";
  for (int i = 0; i < 1000; ++i) check->Look(absl::ZeroDuration());
  EXPECT_LE(check->counts().bytes, before + 1'000'000 + tile) << "what a second allows";
}

}  // namespace
}  // namespace silhouette
