// SPDX-License-Identifier: Apache-2.0
// A recording of what a test server says.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "common/recording/recorder.h"
#include "server/page/replay.h"
#include "tests/server/page/looking.h"

namespace silhouette {

// Scenes of 0.1 s each, by the clock of a test server.
class RecordedServer {
 public:
  RecordedServer()
      : test(NewDatabase({.index = true})), recorder({.folder = folder}, test.GetDatabase()) {
    State();
  }

  void State(v1::Verdict::Reason unknown = {}, const std::string& message = "") {
    v1::WatchScenesResponse news;
    v1::ServedState& state = *news.mutable_state();
    state.set_unknown_reason(unknown);
    if (!message.empty()) {
      state.add_defects()->set_message(message);
      state.mutable_defects(0)->set_reason(unknown);
    }
    Take(news);
  }
  // Publishes a scene, and records it. `change` may change what is recorded.
  void Scene(
      const SceneInput& input, const std::function<void(v1::Scene&)>& change = [](v1::Scene&) {}) {
    test.clock.Advance(absl::Milliseconds(100));
    test.Publish(input);
    v1::GetSceneRequest request;
    request.set_include_planes(true);
    v1::WatchScenesResponse news;
    *news.mutable_scene() = test.Ask(&v1::SceneService::Stub::GetScene, request).scene();
    change(*news.mutable_scene());
    Take(news);
  }
  // Records the answer to a client that watches the path from (0, 4) to (4, 4).
  void Path() {
    v1::WatchScenesResponse news;
    v1::WatchedPath& path = *news.add_paths();
    path.set_id(1);
    path.set_client("planner");
    for (const int a : {0, 4}) Set(At(a, 4), path.mutable_request()->add_waypoints());
    *path.mutable_answer()->mutable_check() = test.Path({At(0, 4), At(4, 4)});
    Take(news);
  }
  void Take(const v1::WatchScenesResponse& news) {
    const absl::Time now = test.clock.now();
    recorder.Take(news, {.wall = now, .running = now - absl::UnixEpoch()});
  }
  // Milliseconds since 1970.
  int64_t now() { return absl::ToUnixMillis(test.clock.now()); }
  nlohmann::json Live() { return PageSnapshot(test.server->serving(), {}); }

  // Ends the recording.
  std::unique_ptr<Replay> Open() {
    EXPECT_TRUE(recorder.Close().ok());
    auto replay =
        Replay::Open(recorder.path(), test.server->database(), test.server->serving().settings);
    EXPECT_TRUE(replay.ok()) << replay.status();
    return *std::move(replay);
  }

  const std::string folder = FreshFolder();
  TestServer test;
  Recorder recorder;
};

}  // namespace silhouette
