// SPDX-License-Identifier: Apache-2.0
// WatchScenes, as a recorder sees it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>

#include "tests/server/service/test_server.h"
#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

using ::testing::SizeIs;

class SceneWatching {
 public:
  explicit SceneWatching(TestServer& server) : stub_(v1::SceneService::NewStub(server.channel)) {
    context_.set_deadline(std::chrono::system_clock::now() + std::chrono::minutes(1));
    reader_ = stub_->WatchScenes(&context_, {});
  }
  ~SceneWatching() { context_.TryCancel(); }

  v1::WatchScenesResponse Next() {
    v1::WatchScenesResponse news;
    EXPECT_TRUE(reader_->Read(&news));
    return news;
  }
  // The next message with a scene.
  v1::Scene NextScene() {
    while (!::testing::Test::HasFailure()) {
      v1::WatchScenesResponse news = Next();
      if (news.has_scene()) return news.scene();
    }
    return {};
  }
  v1::WatchedPath NextPath() {
    while (!::testing::Test::HasFailure()) {
      v1::WatchScenesResponse news = Next();
      if (news.paths_size() > 0) return news.paths(0);
    }
    return {};
  }

 private:
  grpc::ClientContext context_;
  const std::unique_ptr<v1::SceneService::Stub> stub_;
  std::unique_ptr<grpc::ClientReader<v1::WatchScenesResponse>> reader_;
};

class SceneWatchServiceTest : public ::testing::Test {
 protected:
  TestServer server{NewDatabase({.index = true})};
};

TEST_F(SceneWatchServiceTest, FirstIsWhatIsKnownNow) {
  SceneWatching watching(server);
  const v1::WatchScenesResponse first = watching.Next();
  EXPECT_TRUE(first.has_state());
  EXPECT_EQ(first.state().unknown_reason(), v1::Verdict::REASON_NO_SCENE);
  EXPECT_THAT(first.state().defects(), SizeIs(1));
  EXPECT_EQ(first.state().database_generation(), server.GetDatabase().generation());
}

TEST_F(SceneWatchServiceTest, EveryScenePublishedIsSentWithItsPlanes) {
  server.Publish(EmptyCellScene());
  SceneWatching watching(server);
  EXPECT_EQ(watching.NextScene().id(), 1u);
  // Faster than they are sent.
  for (int i = 0; i < 10; ++i) server.Publish(SceneWithBlock(3));
  for (uint64_t id = 2; id <= 11; ++id) {
    const v1::Scene scene = watching.NextScene();
    ASSERT_EQ(scene.id(), id);
    ASSERT_EQ(scene.views_size(), 3);
    EXPECT_TRUE(scene.views(0).has_scene());
    EXPECT_TRUE(scene.views(0).has_obstacle());
    EXPECT_FALSE(scene.joints().empty());
  }
}

TEST_F(SceneWatchServiceTest, AnswersToWatchedPathsAndTheirEndAreSent) {
  server.Publish(EmptyCellScene());
  SceneWatching watching(server);
  {
    PathWatching path(server, {At(0, 0), At(4, 0)});
    path.Next();
    const v1::WatchedPath first = watching.NextPath();
    EXPECT_EQ(first.answer().check().verdict().state(), v1::Verdict::STATE_FREE);
    EXPECT_THAT(first.request().waypoints(), SizeIs(2));
    EXPECT_FALSE(first.client().empty());
    server.Publish(SceneWithBlock(3));
    path.Next();
    const v1::WatchedPath second = watching.NextPath();
    EXPECT_EQ(second.id(), first.id());
    EXPECT_EQ(second.answer().check().basis().scene_id(), 2u);
    EXPECT_EQ(second.answer().check().verdict().state(), v1::Verdict::STATE_OCCUPIED);
  }
  // Without a further scene.
  EXPECT_TRUE(watching.NextPath().ended());
}

TEST_F(SceneWatchServiceTest, SceneThatBecomesTooOldAndRegionsAreSent) {
  server.Publish(EmptyCellScene());
  SceneWatching watching(server);
  watching.NextScene();
  server.Allow("part", 2, absl::Minutes(1));
  v1::WatchScenesResponse news = watching.Next();
  ASSERT_TRUE(news.has_state());
  EXPECT_EQ(news.state().unknown_reason(), v1::Verdict::REASON_UNSPECIFIED);
  ASSERT_THAT(news.state().regions(), SizeIs(1));
  EXPECT_EQ(news.state().regions(0).name(), "part");
  server.clock.Advance(absl::Seconds(2));
  news = watching.Next();
  ASSERT_TRUE(news.has_state());
  EXPECT_EQ(news.state().unknown_reason(), v1::Verdict::REASON_SCENE_STALE);
}

}  // namespace
}  // namespace silhouette
