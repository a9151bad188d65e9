// SPDX-License-Identifier: Apache-2.0
// A client that knows the truth of a server's cell, and judges everything that it says.
#pragma once

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/time/clock.h"
#include "server/scene/clock.h"
#include "silhouette/client.h"
#include "silhouette/local_space.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"
#include "tests/random.h"
#include "tests/server/test_cell.h"

namespace silhouette {

// Publishes scenes of the cell of test_cell.h, asks for verdicts on all of its configurations and
// watches its map, all the time. A verdict FREE is justified if the scene that it names was
// published, was not older than kMaxAge when the verdict was asked for, and shows the configuration
// free. A scene whose number the server has not answered yet may be any that is not known. Any
// other FREE is a failure, and so is an answer from an older scene than that of an answer before.
class Checker {
 public:
  static constexpr absl::Duration kMaxAge = absl::Milliseconds(400);  // as the server has it

  explicit Checker(const std::string& address)
      : client_(*client::Client::Connect(address, absl::Seconds(1))),
        channel_(grpc::CreateChannel(address, grpc::InsecureChannelCredentials())),
        space_(client_, {.max_age = kMaxAge}),
        threads_{} {
    threads_.emplace_back([this] { PublishAll(); });
    threads_.emplace_back([this] { AskAll(); });
    threads_.emplace_back([this] { LookAll(); });
  }
  ~Checker() { Stop(); }
  Checker(const Checker&) = delete;
  Checker& operator=(const Checker&) = delete;

  // Fails the test for each verdict that was not justified, with the faults that were noted.
  void Stop() {
    stopped_ = true;
    threads_.clear();
    const std::lock_guard lock(mutex_);
    for (const std::string& wrong : std::exchange(wrong_, {})) ADD_FAILURE() << wrong;
  }

  // Says what is done to the server from now on.
  void Note(const std::string& fault) {
    const std::lock_guard lock(mutex_);
    fault_ = fault;
  }

  // Waits for `more` verdicts FREE from calls, and as many from the map; false: they did not come
  // within `most`.
  bool WaitForFree(int more, absl::Duration most = absl::Seconds(20)) const {
    const int asked = asked_free_ + more;
    const int looked = looked_free_ + more;
    const absl::Duration end = RunningNow() + most;
    while (RunningNow() < end) {
      if (asked_free_ >= asked && looked_free_ >= looked) return true;
      absl::SleepFor(absl::Milliseconds(2));
    }
    return false;
  }

  int free() const { return asked_free_ + looked_free_; }
  int published() const { return published_; }

 private:
  // A scene with a block on joint a's way, or none at 0.
  struct Published {
    uint64_t id = 0;  // 0: the server's answer did not come
    int block = 0;
    absl::Duration captured;
    bool Frees(int a) const { return block == 0 || block != a; }
  };

  static absl::Duration RunningNow() { return SystemClock().running; }

  void Wrong(const std::string& what) {
    const std::lock_guard lock(mutex_);
    if (wrong_.size() < 5) wrong_.push_back(what + ", while: " + fault_);
  }

  void PublishAll() {
    Random random;
    const auto stub = v1::SceneService::NewStub(channel_);
    while (!stopped_) {
      Published scene{.block = static_cast<int>(random() % 5), .captured = RunningNow()};
      v1::PublishSceneRequest request = RequestFor(scene);
      {
        const std::lock_guard lock(mutex_);
        scenes_.push_back(scene);  // before it can be answered from
        while (scenes_.size() > 4000) scenes_.pop_front();
      }
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(1));
      v1::PublishSceneResponse response;
      if (stub->PublishScene(&context, request, &response).ok()) {
        const std::lock_guard lock(mutex_);
        scenes_.back().id = response.scene().id();
        ++published_;
      }
      absl::SleepFor(absl::Milliseconds(10 + static_cast<int>(random() % 20)));
    }
  }

  // Stamped with the running clock, which server and test share.
  static v1::PublishSceneRequest RequestFor(const Published& scene) {
    v1::PublishSceneRequest request;
    for (const JointPosition& joint : JointsAt(At(0, 0))) {
      v1::JointPosition& added = *request.add_joints();
      added.set_name(joint.name);
      added.set_position(joint.position);
    }
    for (int view = 0; view < 3; ++view) {
      Mask seen = RobotMask(view, 0, 0);
      if (scene.block != 0) seen = seen | Block(view, scene.block);
      v1::ViewImage& image = *request.add_views();
      image.set_view(kViewNames[static_cast<size_t>(view)]);
      const int64_t nanoseconds = absl::ToInt64Nanoseconds(scene.captured);
      image.mutable_server_clock()->set_seconds(nanoseconds / 1'000'000'000);
      image.mutable_server_clock()->set_nanos(static_cast<int32_t>(nanoseconds % 1'000'000'000));
      image.mutable_scene_mask()->set_width(seen.width());
      image.mutable_scene_mask()->set_height(seen.height());
      image.mutable_scene_mask()->set_bits(seen.ToBytes());
    }
    return request;
  }

  // Whether a FREE of joint a at `a`, asked for at `asked`, is justified. `id`: of the scene that
  // the answer names.
  bool Justified(int a, absl::Duration asked, uint64_t id) {
    if (id == 0) return false;
    const std::lock_guard lock(mutex_);
    const auto frees = [&](const Published& scene) {
      return scene.captured >= asked - kMaxAge && scene.Frees(a);
    };
    const auto named = std::ranges::find(scenes_, id, &Published::id);
    if (named != scenes_.end()) return frees(*named);
    return std::ranges::any_of(
        scenes_, [&](const Published& scene) { return scene.id == 0 && frees(scene); });
  }

  void AskAll() {
    std::vector<Configuration> configurations;
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) configurations.push_back(At(a, b));
    }
    uint64_t newest = 0;
    while (!stopped_) {
      const absl::Duration asked = RunningNow();
      const auto checks = client_.CheckConfigurations(configurations, {}, client::Evidence::kOmit);
      if (checks.ok() && checks->basis.scene_id != 0) {
        if (checks->basis.scene_id < newest) Wrong("a scene came back");
        newest = checks->basis.scene_id;
      }
      for (size_t i = 0; checks.ok() && i < configurations.size(); ++i) {
        if (!checks->verdicts[i].free()) continue;
        const int a = static_cast<int>(i / 8);
        if (!Justified(a, asked, checks->basis.scene_id)) {
          Wrong(absl::StrCat("a = ", a, " was FREE by scene ", checks->basis.scene_id));
        }
        ++asked_free_;
      }
      absl::SleepFor(absl::Milliseconds(3));
    }
  }

  void LookAll() {
    while (!stopped_) {
      for (int a = 0; a < 5; ++a) {
        const absl::Duration asked = RunningNow();
        client::Basis basis;
        if (!space_.Check(At(a, 3), &basis).free()) continue;
        if (!Justified(a, asked, basis.scene_id)) {
          Wrong(absl::StrCat("a = ", a, " was FREE in the map of scene ", basis.scene_id));
        }
        ++looked_free_;
      }
      absl::SleepFor(absl::Milliseconds(1));
    }
  }

  const client::Client client_;
  const std::shared_ptr<grpc::Channel> channel_;
  std::mutex mutex_;
  std::deque<Published> scenes_;
  std::string fault_ = "nothing is done to it";
  std::vector<std::string> wrong_;
  std::atomic<bool> stopped_ = false;
  std::atomic<int> asked_free_ = 0;
  std::atomic<int> looked_free_ = 0;
  std::atomic<int> published_ = 0;
  client::LocalSpace space_;
  std::vector<std::jthread> threads_;
};

}  // namespace silhouette
