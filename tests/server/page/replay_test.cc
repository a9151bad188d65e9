// SPDX-License-Identifier: Apache-2.0
#include "server/page/replay.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "tests/server/page/recorded.h"

namespace silhouette {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

// Nothing of the moment is free.
void ExpectUnknown(const json& shown) {
  EXPECT_NE(shown["blocked"], "");
  EXPECT_TRUE(shown["space"]["cells"].is_null()) << shown["space"];
  EXPECT_TRUE(shown["space"]["counts"].is_null());
  EXPECT_TRUE(shown["present"].is_null() || shown["present"]["state"] == "unknown");
  for (const json& path : shown["paths"]) EXPECT_EQ(path["state"], "unknown");
}

TEST(Replay, AMomentIsShownAsThePageShowedIt) {
  RecordedServer cell;
  std::vector<std::pair<int64_t, json>> live;
  for (const int block : {2, 3, 4}) {
    cell.Scene(SceneWithBlock(block));
    live.emplace_back(cell.now(), cell.Live());
  }
  const auto replay = cell.Open();
  for (const size_t i : {2, 0, 1}) {
    const json shown = replay->At(live[i].first, {});
    for (const char* part : {"scene", "views", "space", "present", "blocked", "max_age", "units"}) {
      EXPECT_EQ(shown[part], live[i].second[part]) << part;
    }
    EXPECT_EQ(shown["basis"]["scene_id"], live[i].second["basis"]["scene_id"]);
    EXPECT_EQ(shown["basis"]["scene_age"], live[i].second["basis"]["scene_age"]);
    EXPECT_THAT(shown["space"]["cells"].get<std::string>(), HasSubstr("f"));
  }
}

TEST(Replay, AGapShowsNoSceneAndNothingIsFree) {
  RecordedServer cell;
  cell.Scene(SceneWithBlock(2));
  cell.Path();
  const int64_t scene = cell.now();
  cell.test.clock.Advance(absl::Seconds(10));
  cell.Scene(SceneWithBlock(2));
  const auto replay = cell.Open();
  EXPECT_EQ(replay->At(scene + 900, {})["blocked"], "");
  const json gap = replay->At(scene + 5000, {});
  EXPECT_TRUE(gap["scene"].is_null());
  EXPECT_EQ(gap["basis"]["defects"][0]["message"], "no scene is recorded at this time");
  ExpectUnknown(gap);
  EXPECT_EQ(gap["replay"]["previous"], scene);
  EXPECT_EQ(gap["replay"]["next"], cell.now());
}

TEST(Replay, ASceneHasTheDefectsOfThen) {
  RecordedServer cell;
  cell.Scene(SceneWithBlock(2), [](v1::Scene& scene) {
    scene.add_defects()->set_message("the light changed");
    scene.mutable_defects(0)->set_reason(v1::Verdict::REASON_LIGHT_CHANGED);
  });
  const auto replay = cell.Open();
  const json shown = replay->At(cell.now(), {});
  EXPECT_EQ(shown["blocked"], "light changed");
  EXPECT_EQ(shown["basis"]["defects"][0]["message"], "the light changed");
  EXPECT_FALSE(shown["views"]["left"]["robot"].is_null());
  ExpectUnknown(shown);
}

TEST(Replay, ADefectOfAnUnknownKindIsADefect) {
  for (const int reason : {0, 200}) {
    RecordedServer cell;
    cell.Scene(SceneWithBlock(2), [&](v1::Scene& scene) {
      scene.add_defects()->set_reason(static_cast<v1::Verdict::Reason>(reason));
    });
    ExpectUnknown(cell.Open()->At(cell.now(), {}));
  }
}

TEST(Replay, WhereTheServerKnewNothingNothingIsKnown) {
  RecordedServer cell;
  cell.State(v1::Verdict::REASON_DATABASE_DAMAGED, "tile 7 is damaged");
  cell.Scene(SceneWithBlock(2));
  const json shown = cell.Open()->At(cell.now(), {});
  EXPECT_EQ(shown["blocked"], "database damaged");
  EXPECT_EQ(shown["basis"]["defects"][0]["message"], "tile 7 is damaged");
  ExpectUnknown(shown);
}

TEST(Replay, WithoutARecordedStateNothingIsFree) {
  RecordedServer cell;
  Recorder without({.folder = cell.folder + "/without"}, cell.test.GetDatabase());
  std::filesystem::create_directory(cell.folder + "/without");
  cell.Scene(SceneWithBlock(2), [&](v1::Scene& scene) {
    v1::WatchScenesResponse news;
    *news.mutable_scene() = scene;
    without.Take(news, {.wall = cell.test.clock.now(), .running = {}});
  });
  ASSERT_TRUE(without.Close().ok());
  const auto replay = Replay::Open(without.path(), cell.test.server->database(), ServingSettings());
  ASSERT_TRUE(replay.ok()) << replay.status();
  ExpectUnknown((*replay)->At(cell.now(), {}));
}

TEST(Replay, AllowedRegionsAreThoseOfThen) {
  RecordedServer cell;
  cell.test.Allow("part", 2, absl::Minutes(1));
  v1::WatchScenesResponse news;
  *news.mutable_state()->mutable_regions() =
      cell.test.Ask(&v1::SceneService::Stub::ListAllowedRegions, v1::ListAllowedRegionsRequest())
          .regions();
  cell.Take(news);
  cell.Scene(SceneWithBlock(2));
  const json live = cell.Live();
  const json shown = cell.Open()->At(cell.now(), {});
  EXPECT_EQ(shown["basis"]["regions"], json({"part"}));
  EXPECT_EQ(shown["space"], live["space"]);
  EXPECT_EQ(shown["views"], live["views"]);
  EXPECT_EQ(shown["regions"], live["regions"]);
}

TEST(Replay, AStopIsOnTheTimeLineWithItsEvidence) {
  RecordedServer cell;
  cell.Scene(EmptyCellScene());
  cell.Path();
  cell.Scene(SceneWithBlock(2));
  cell.Path();
  const int64_t stop = cell.now();
  const auto replay = cell.Open();
  const json line = replay->TimeLine();
  ASSERT_EQ(line["stops"].size(), 1u);
  EXPECT_EQ(line["stops"][0]["time"], stop);
  EXPECT_EQ(line["stops"][0]["state"], "occupied");
  EXPECT_EQ(line["scenes"], json({{stop - 100, stop}}));
  const json shown = replay->At(stop, {});
  ASSERT_EQ(shown["paths"].size(), 1u);
  EXPECT_EQ(shown["paths"][0]["state"], "occupied");
  v1::Mask block;
  Set(Block(0, 2), &block);
  EXPECT_EQ(shown["paths"][0]["why"]["left"]["convicts"], JsonText(block));
  EXPECT_EQ(replay->At(stop - 1, {})["paths"][0]["state"], "free");
  EXPECT_EQ(shown["replay"]["previous"], stop - 100);
  EXPECT_TRUE(shown["replay"]["next"].is_null());
}

TEST(Replay, OtherCellsAndMissingFilesAreRefused) {
  RecordedServer cell;
  cell.Scene(SceneWithBlock(2));
  cell.Open();
  TestDatabase other;
  other.cell.set_name("other");
  const auto refused =
      Replay::Open(cell.recorder.path(), NewDatabase(other), ServingSettings()).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("'other'"));
  EXPECT_EQ(Replay::Open(cell.folder + "/none", NewDatabase(), ServingSettings()).status().code(),
            absl::StatusCode::kNotFound);
}

TEST(Replay, AnotherGridOfTheSameCellIsRefused) {
  RecordedServer cell;
  cell.Scene(SceneWithBlock(2));
  cell.Open();
  TestDatabase other;
  other.cell.mutable_grid_joints(0)->set_steps(6);
  const auto database = NewDatabase(other);
  EXPECT_EQ(database->cell().name(), cell.test.server->database()->cell().name());
  const auto refused = Replay::Open(cell.recorder.path(), database, ServingSettings()).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("another cell or grid"));
}

TEST(Replay, AMomentThatCannotBeShownHasItsPlaceAmongTheScenes) {
  RecordedServer cell;
  cell.Scene(EmptyCellScene());
  cell.Scene(EmptyCellScene(), [](v1::Scene& scene) {
    Set(Mask({8, 8}), scene.mutable_views(0)->mutable_scene());
  });
  const int64_t broken = cell.now();
  cell.Scene(EmptyCellScene());
  const json shown = cell.Open()->At(broken, {});
  EXPECT_THAT(shown["error"].get<std::string>(), HasSubstr("8x8"));
  EXPECT_EQ(shown["replay"],
            json({{"time", broken}, {"previous", broken - 100}, {"next", broken + 100}}));
}

TEST(Replay, AMomentThatCannotBeReadHasItsPlaceAmongTheScenes) {
  RecordedServer cell;
  cell.Scene(EmptyCellScene());
  cell.Scene(EmptyCellScene());
  const int64_t lost = cell.now();
  ASSERT_TRUE(cell.recorder.Flush().ok());  // what is read last stays in memory
  cell.Scene(EmptyCellScene());
  const auto replay = cell.Open();
  std::filesystem::resize_file(cell.recorder.path(), 0);
  const json shown = replay->At(lost, {});
  EXPECT_THAT(shown["error"].get<std::string>(), HasSubstr(cell.recorder.path()));
  EXPECT_EQ(shown["replay"],
            json({{"time", lost}, {"previous", lost - 100}, {"next", lost + 100}}));
}

TEST(Replay, ThePageOnlyAnswersWhatWasKnown) {
  RecordedServer cell;
  cell.Scene(SceneWithBlock(2));
  const auto replay = cell.Open();
  const auto page = *CellPage::Start("127.0.0.1:0", /*insecure=*/false, *replay);
  httplib::Client client("http://" + page->address());
  EXPECT_THAT(client.Get("/")->body, HasSubstr("not the cell as it is now"));
  EXPECT_EQ(client.Get("/replay.js")->status, 200);
  EXPECT_EQ(json::parse(client.Get("/recording")->body), replay->TimeLine());
  const std::string moment = absl::StrCat("/moment?time=", cell.now());
  EXPECT_EQ(json::parse(client.Get(moment)->body), replay->At(cell.now(), {}));
  EXPECT_EQ(client.Get("/events")->status, 404);
  EXPECT_EQ(client.Get("/moment?time=soon")->status, 400);
  EXPECT_EQ(client.Get(moment + "&x=seven")->status, 400);
  EXPECT_EQ(client.Post(moment, "x", "text/plain")->status, 404);
  for (const std::string path : {"/recording", moment.c_str()}) {
    EXPECT_EQ(client.Get(path, {{"Sec-Fetch-Site", "cross-site"}})->status, 403);
    EXPECT_EQ(client.Get(path, {{"Host", "evil.example"}})->status, 421);
  }
}

}  // namespace
}  // namespace silhouette
