// SPDX-License-Identifier: Apache-2.0
#include "server/scene/scene_store.h"

#include <gmock/gmock.h>

#include "server/scene/checker.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

const absl::Time kStart = absl::FromUnixSeconds(1'000'000);
const Moment kSceneStoreNow{kStart, absl::Seconds(50)};

// Taken at `captured` by the wall clock, and arrived by then.
Scene SceneStoreSceneOf(const ServedDatabase& database, absl::Time captured) {
  return *MakeScene(database, EmptyCellScene(), {}, {}, MomentOf(captured, kSceneStoreNow));
}

TEST(SceneStore, HasNoSceneAtFirst) {
  const auto database = NewDatabase();
  SceneStore store(database);
  EXPECT_EQ(store.Newest(kSceneStoreNow).scene, nullptr);
  EXPECT_EQ(store.Newest(kSceneStoreNow).database, database);
  EXPECT_EQ(store.Newest(kSceneStoreNow).without_scene, Reason::kNoScene);
  EXPECT_EQ(store.Find(0), nullptr);
}

TEST(SceneStore, CountsScenesUpAndKeepsSoMany) {
  const auto database = NewDatabase();
  SceneStore store(database, 3);
  for (uint64_t id = 1; id <= 5; ++id) {
    const auto scene =
        store.Publish(SceneStoreSceneOf(*database, kStart + id * absl::Milliseconds(10)), database);
    ASSERT_TRUE(scene.ok()) << scene.status();
    EXPECT_EQ((*scene)->id, id);
    EXPECT_EQ(store.Newest(kSceneStoreNow).scene, *scene);
    EXPECT_EQ(store.Find(0), *scene);
  }
  EXPECT_EQ(store.Find(2), nullptr);
  EXPECT_EQ(store.Find(6), nullptr);
  EXPECT_EQ(store.Find(3)->id, 3u);
}

TEST(SceneStore, OlderImagesThanThoseServedAreRefused) {
  const auto database = NewDatabase();
  SceneStore store(database);
  ASSERT_TRUE(store.Publish(SceneStoreSceneOf(*database, kStart), database).ok());
  const auto older =
      store.Publish(SceneStoreSceneOf(*database, kStart - absl::Milliseconds(3)), database);
  EXPECT_TRUE(absl::IsFailedPrecondition(older.status()));
  EXPECT_EQ(older.status().message(),
            "the images are 3 ms older than those of scene 1, which is served");
  EXPECT_EQ(store.Newest(kSceneStoreNow).scene->id, 1u);
  EXPECT_TRUE(store.Publish(SceneStoreSceneOf(*database, kStart), database).ok()) << "equally old";
}

TEST(SceneStore, NewerImagesAreServedThoughAnotherViewsImageIsLate) {
  const auto database = NewDatabase();
  SceneStore store(database);
  const auto publish = [&](std::vector<absl::Duration> taken) {
    SceneInput input = EmptyCellScene();
    for (size_t view = 0; view < 3; ++view) {
      input.views[view].captured = MomentOf(kStart + taken[view], kSceneStoreNow);
    }
    return store.Publish(*MakeScene(*database, input, {}, {}, kSceneStoreNow), database);
  };
  const auto ms = [](int count) { return absl::Milliseconds(count); };
  ASSERT_TRUE(publish({ms(-400), ms(-400), ms(-400)}).ok());
  const auto late = publish({ms(-200), ms(-200), ms(-700)});
  ASSERT_TRUE(late.ok()) << late.status();
  EXPECT_EQ((*late)->Blocked(), Reason::kSceneSkewed);
  EXPECT_EQ((*late)->AgeAt(kSceneStoreNow), ms(700));
  EXPECT_TRUE(publish({ms(-200), ms(-200), ms(-200)}).ok()) << "the late image has come";
  EXPECT_TRUE(absl::IsFailedPrecondition(publish({ms(-300), ms(-250), ms(-250)}).status()));
  const auto same = publish({ms(-200), ms(-200), ms(-700)});
  EXPECT_EQ(same.status().message(),
            "the images are 500 ms older than those of scene 3, which is served");
}

TEST(SceneStore, SceneWithoutImagesKeepsNoLaterOneOutHoweverLongItsImagesWereUnderWay) {
  const auto database = NewDatabase();
  for (const bool first : {true, false}) {
    SceneStore store(database);
    if (!first) {
      ASSERT_TRUE(
          store.Publish(SceneStoreSceneOf(*database, kStart - absl::Seconds(1)), database).ok());
    }
    SceneInput none = EmptyCellScene();
    for (ViewInput& view : none.views) view.image = LeftOut{};
    const auto empty = store.Publish(*MakeScene(*database, none, {}, {}, kSceneStoreNow), database);
    ASSERT_TRUE(empty.ok()) << empty.status();
    EXPECT_EQ(store.Newest(kSceneStoreNow).scene, *empty);
    const auto next =
        store.Publish(SceneStoreSceneOf(*database, kStart - absl::Milliseconds(500)), database);
    EXPECT_TRUE(next.ok()) << next.status();
    EXPECT_LE(store.LongestGap(), absl::Seconds(1)) << "not the time since the start";
  }
}

TEST(SceneStore, WallClockThatIsSetNeitherRefusesNewImagesNorMakesOldOnesYoung) {
  for (const double step : {-60.0, -5.0, 5.0, 60.0}) {
    const auto database = NewDatabase();
    SceneStore store(database);
    const auto publish = [&](const Moment& arrived, absl::Duration ago) {
      SceneInput input = EmptyCellScene();
      for (ViewInput& view : input.views) {
        view.captured = MomentOf(arrived.time - ago, arrived);
      }
      return store.Publish(*MakeScene(*database, input, {}, {}, arrived), database);
    };
    Moment now = kSceneStoreNow;
    ASSERT_TRUE(publish(now, absl::Milliseconds(20)).ok());
    now.time += absl::Seconds(step);
    EXPECT_EQ(store.Newest(now).scene->AgeAt(now), absl::Milliseconds(20)) << step;
    now = {now.time + absl::Milliseconds(30), now.running + absl::Milliseconds(30)};
    const auto next = publish(now, absl::Milliseconds(20));
    ASSERT_TRUE(next.ok()) << step << ": " << next.status();
    EXPECT_EQ((*next)->AgeAt(now), absl::Milliseconds(20)) << step;
    const auto older = publish(now, absl::Milliseconds(50));
    EXPECT_TRUE(absl::IsFailedPrecondition(older.status())) << step;
  }
}

Scene SceneThatArrived(const ServedDatabase& database, const Moment& arrived) {
  return *MakeScene(database, EmptyCellScene(), {}, {}, arrived);
}

TEST(SceneStore, WithdrawnSceneIsServedAnewAndNeverFree) {
  const auto database = NewDatabase();
  SceneStore store(database);
  store.Withdraw("nothing yet", {kStart, absl::Seconds(1)});
  EXPECT_EQ(store.last_withdrawn(), 0u);
  ASSERT_TRUE(store.Publish(SceneThatArrived(*database, kSceneStoreNow), database).ok());
  const Served before = store.Newest(kSceneStoreNow);
  EXPECT_TRUE(Checker(before, {}, {}, kSceneStoreNow).Check(At(3, 3)).free());
  EXPECT_FALSE(store.Withdrawn(*before.scene));
  store.Withdraw("it has another tool", kSceneStoreNow);
  EXPECT_TRUE(store.Withdrawn(*before.scene)) << "for answers that are under way";
  EXPECT_EQ(store.last_withdrawn(), 2u);
  const Served after = store.Newest(kSceneStoreNow);
  EXPECT_EQ(after.scene->id, 2u);
  EXPECT_EQ(after.scene->variant, "");
  ASSERT_EQ(after.scene->defects.size(), 1u);
  EXPECT_EQ(after.scene->defects[0].message, "it has another tool");
  EXPECT_EQ(Checker(after, {}, {}, kSceneStoreNow).Check(At(3, 3)).reason(),
            Reason::kVariantUnknown);
  store.Withdraw("and another", kSceneStoreNow);
  ASSERT_EQ(store.Newest(kSceneStoreNow).scene->defects.size(), 1u);
  EXPECT_EQ(store.Newest(kSceneStoreNow).scene->defects[0].message, "and another");
}

TEST(SceneStore, SceneThatArrivedBeforeItWasWithdrawnComesWithdrawn) {
  const auto database = NewDatabase();
  SceneStore store(database);
  const Moment later{kSceneStoreNow.time + absl::Seconds(1),
                     kSceneStoreNow.running + absl::Seconds(1)};
  store.Withdraw("it has another tool", kSceneStoreNow);
  const auto late = store.Publish(SceneThatArrived(*database, kSceneStoreNow), database);
  ASSERT_TRUE(late.ok()) << late.status();
  EXPECT_EQ((*late)->Blocked(), Reason::kVariantUnknown);
  const auto next = store.Publish(SceneThatArrived(*database, later), database);
  ASSERT_TRUE(next.ok()) << next.status();
  EXPECT_EQ((*next)->Blocked(), Reason::kNone);
  EXPECT_TRUE(Checker(store.Newest(later), {}, {}, later).Check(At(3, 3)).free());
}

TEST(SceneStore, AfterAChangeOfTheDatabaseNoOldSceneIsServed) {
  const auto database = NewDatabase();
  SceneStore store(database);
  ASSERT_TRUE(store.Publish(SceneStoreSceneOf(*database, kStart), database).ok());
  const Served before = store.Newest(kSceneStoreNow);
  const auto next = NewDatabase({.missing = {{0, 1}}});
  store.ReplaceDatabase(next);
  EXPECT_EQ(store.Newest(kSceneStoreNow).scene, nullptr);
  EXPECT_EQ(store.Newest(kSceneStoreNow).database, next);
  EXPECT_EQ(store.Newest(kSceneStoreNow).without_scene, Reason::kGenerationMismatch);
  EXPECT_EQ(store.Find(1), nullptr);
  EXPECT_EQ(before.scene->id, 1u) << "a request under way keeps what it began with";
  const auto late = store.Publish(SceneStoreSceneOf(*database, kStart), database);
  EXPECT_TRUE(absl::IsAborted(late.status())) << "made with the old robot images";
  const auto scene = store.Publish(SceneStoreSceneOf(*next, kStart), next);
  ASSERT_TRUE(scene.ok());
  EXPECT_EQ((*scene)->id, 2u) << "ids are not used again";
  EXPECT_EQ(store.Newest(kSceneStoreNow).without_scene, Reason::kNone);
}

TEST(SceneStore, ChangeOfTheDatabaseBeforeTheFirstSceneIsStillNoScene) {
  SceneStore store(NewDatabase());
  store.ReplaceDatabase(NewDatabase());
  EXPECT_EQ(store.Newest(kSceneStoreNow).without_scene, Reason::kNoScene);
}

}  // namespace
}  // namespace silhouette
