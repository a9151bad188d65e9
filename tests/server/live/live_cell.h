// SPDX-License-Identifier: Apache-2.0
// A live cell for tests: the cell of tests/server/test_cell.h with cameras and a robot that can be
// made to fail, and the loop that takes their images.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "server/live/live_loop.h"
#include "server/scene/checker.h"
#include "server/scene/scene_store.h"
#include "tests/server/tool_variant.h"

namespace silhouette {

// What the devices do; guarded by the mutex. The cameras' order is not that of the database.
struct LiveScript {
  std::mutex mutex;
  // Where the robot stands: grid point (a, 0); `joints` is what it tells, in the order lift, b, a.
  int robot_a = 0;
  bool tool = false;  // of tests/server/tool_variant.h
  std::vector<double> joints = {0.5, At(0, 0)[1], At(0, 0)[0]};
  double joint_drift = 0;      // added to joint a with every answer
  absl::Duration joints_late;  // how long ago they were measured; zero: when they are asked for
  absl::Status robot_error = absl::OkStatus();
  // By view of the database.
  std::vector<absl::Status> camera_errors = {3, absl::OkStatus()};
  std::vector<absl::Duration> stamps = {3, absl::ZeroDuration()};  // added to the capture times
  std::vector<int> blocks = {-1, -1, -1};                          // blocks where a is; -1: none
  // Changes a set of images, in the order of the cameras.
  std::function<void(std::vector<absl::StatusOr<CameraImage>>&)> change = nullptr;
  bool noise = true;  // of up to a grey level, other with every set
  absl::Status open_cameras = absl::OkStatus();
  absl::Status open_robot = absl::OkStatus();
  int cameras_opened = 0;
  int robots_opened = 0;
  int grabs = 0;
};

inline CameraImage ImageOfView(int view, const LiveScript& script) {
  const int block = script.blocks[static_cast<size_t>(view)];
  Mask foreground =
      script.tool ? ToolMask(view, script.robot_a, 0) : RobotMask(view, script.robot_a, 0);
  if (block >= 0) foreground = foreground | Block(view, block);
  cv::Mat picture = CameraPicture(view, foreground);
  if (script.noise) {
    std::minstd_rand random(static_cast<unsigned>(script.grabs));
    for (uint8_t& level : cv::Mat_<uint8_t>(picture)) level += random() >> 8 & 1;
  }
  return {.width = picture.cols,
          .height = picture.rows,
          .channels = 1,
          .pixels = {picture.datastart, picture.dataend},
          .captured = absl::Now() + script.stamps[static_cast<size_t>(view)]};
}

class ScriptedCameras : public CameraRig {
 public:
  explicit ScriptedCameras(LiveScript& script) : script_(script) {}
  const std::vector<std::string>& views() const override { return names_; }
  absl::StatusOr<std::vector<CameraImage>> Grab() override {
    return absl::UnimplementedError("the loop asks view by view");
  }
  std::vector<absl::StatusOr<CameraImage>> GrabEach() override {
    const std::lock_guard lock(script_.mutex);
    ++script_.grabs;
    std::vector<absl::StatusOr<CameraImage>> images;
    for (const int view : {2, 0, 1}) {
      const absl::Status& error = script_.camera_errors[static_cast<size_t>(view)];
      if (error.ok()) {
        images.emplace_back(ImageOfView(view, script_));
      } else {
        images.emplace_back(error);
      }
    }
    if (script_.change) script_.change(images);
    return images;
  }

 private:
  LiveScript& script_;
  const std::vector<std::string> names_ = {"top", "left", "right"};
};

class ScriptedRobot : public Robot {
 public:
  explicit ScriptedRobot(LiveScript& script) : script_(script) {}
  const std::vector<std::string>& joints() const override { return names_; }
  absl::Status MoveTo(std::span<const double>) override {
    return absl::UnimplementedError("nobody moves it");
  }
  absl::StatusOr<RobotState> State() override {
    const std::lock_guard lock(script_.mutex);
    if (!script_.robot_error.ok()) return script_.robot_error;
    script_.joints[2] += script_.joint_drift;
    RobotState state{.positions = script_.joints, .moving = script_.joint_drift != 0};
    if (script_.joints_late > absl::ZeroDuration()) {
      state.not_before = RunningNow() - script_.joints_late;
    }
    return state;
  }
  absl::Status Stop() override { return absl::OkStatus(); }

 private:
  LiveScript& script_;
  const std::vector<std::string> names_ = {"lift", "b", "a"};
};

struct LiveCellTest : ::testing::Test {
  LiveScript script;
  LiveConfig config{
      .live = {.interval = absl::Milliseconds(5),
               .joints_interval = absl::Milliseconds(2),
               .joints_gap = absl::Seconds(2),
               .max_joint_movement = 0.01,
               .first_retry = absl::Milliseconds(5),
               .longest_retry = absl::Milliseconds(20)},
      .scene = {.max_age = absl::Seconds(3), .max_skew = absl::Milliseconds(500)},
      // Masks as they were drawn.
      .segmentation = {.faint_difference = 0, .texture_difference = 0, .clean_up_radius = 0},
      .clock = SystemClock};
  std::shared_ptr<const ServedDatabase> database = NewDatabase({.references = true});
  SceneStore scenes{database};
  std::shared_ptr<LiveRecord> record;
  std::unique_ptr<LiveLoop> loop;  // last: it uses the others

  LiveDevices Devices() {
    return {.open_cameras = [this]() -> absl::StatusOr<std::unique_ptr<CameraRig>> {
              const std::lock_guard lock(script.mutex);
              ++script.cameras_opened;
              if (!script.open_cameras.ok()) return script.open_cameras;
              return std::make_unique<ScriptedCameras>(script);
            },
            .open_robot = [this]() -> absl::StatusOr<std::unique_ptr<Robot>> {
              const std::lock_guard lock(script.mutex);
              ++script.robots_opened;
              if (!script.open_robot.ok()) return script.open_robot;
              return std::make_unique<ScriptedRobot>(script);
            }};
  }

  absl::Status Start() {
    const std::string& variant = config.live.variant;
    record = std::make_shared<LiveRecord>(kViewNames, config.scene.max_age, config.clock,
                                          variant.empty() ? KnownVariant() : KnownVariant(variant));
    auto started = LiveLoop::Start(config, Devices(),
                                   {.database = [this] { return scenes.database(); },
                                    .publish =
                                        [this](Scene scene, const auto& made_with) {
                                          return scenes.Publish(std::move(scene), made_with);
                                        }},
                                   record);
    if (started.ok()) loop = *std::move(started);
    return started.status();
  }

  // What a server does when it is told; empty: the variant is changing.
  void Tell(const std::string& variant) {
    const Moment now = SystemClock();
    EXPECT_TRUE(variant.empty() ? record->TellVariantChanging()
                                : record->TellVariant(variant, now.running));
    scenes.Withdraw("told", SystemClock());
  }

  template <typename Change>
  void Script(const Change& change) {
    const std::lock_guard lock(script.mutex);
    change(script);
  }

  // Waits until it holds; a failure after a minute.
  static void WaitUntil(const std::function<bool()>& holds, const std::string& what) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (!holds()) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << "not within a minute: " << what;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }

  SharedScene Newest() const { return scenes.Find(0); }

  // The first scene, of those published from now on, that is like that.
  SharedScene NextScene(const std::string& what, const std::function<bool(const Scene&)>& is) {
    SharedScene found;
    WaitUntil(
        [&] {
          found = Newest();
          return found != nullptr && is(*found);
        },
        what);
    return found;
  }

  static const SceneDefect* DefectOf(const Scene& scene, Reason reason) {
    for (const SceneDefect& defect : scene.defects) {
      if (defect.reason == reason) return &defect;
    }
    return nullptr;
  }
  // `part`: of the defect's message.
  SharedScene SceneWithDefect(Reason reason, const std::string& part = "") {
    return NextScene("a scene with the defect " + NameOf(reason) + ": " + part,
                     [&](const Scene& scene) {
                       const SceneDefect* defect = DefectOf(scene, reason);
                       return defect != nullptr && defect->message.find(part) != std::string::npos;
                     });
  }
  SharedScene GoodScene() {
    return NextScene("a good scene", [](const Scene& scene) { return scene.defects.empty(); });
  }

  Checker CheckerNow(SharedScene scene, const Policy& policy = {}) {
    const Moment now = SystemClock();
    Served served = scenes.Newest(now);
    if (scene != nullptr) served.scene = std::move(scene);
    return Checker(std::move(served), policy, config.scene, now);
  }
  // How many grid points are free by the scene.
  int FreeBy(const SharedScene& scene) {
    const Checker checker = CheckerNow(scene, {.min_views = 1});
    const Checker literal = CheckerNow(scene, {.preset = Preset::kPaper});
    int free = 0;
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) {
        free += checker.Check(At(a, b)).free() || literal.Check(At(a, b)).free() ? 1 : 0;
      }
    }
    return free;
  }
};

}  // namespace silhouette
