// SPDX-License-Identifier: Apache-2.0
// From camera images to the map of all configurations, as the live server gets there and one step
// after another.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/time/clock.h"
#include "capture/segmentation/difference.h"
#include "common/picture/picture.h"
#include "server/live/live_loop.h"
#include "server/scene/configuration_space.h"
#include "server/service/server.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/timing.h"
#include "tests/capture/segmentation/images.h"
#include "tests/test_folder.h"

namespace silhouette::benchmarks {
namespace {

const BenchmarkScene& TheScene(size_t scene) { return ScenesOf1M(SceneKind::kPerson)[scene]; }

// What the view's camera sees of a scene: everything but the background is dark.
cv::Mat PictureOf(size_t scene, int view) {
  const ObstacleImage& image = *TheScene(scene).images[static_cast<size_t>(view)];
  const Mask foreground = image.obstacle() | image.unknown();
  cv::Mat where;
  cv::resize(MaskImage(foreground), where, EmptyCellPicture().size(), 0, 0, cv::INTER_NEAREST);
  cv::Mat light = EmptyCellPicture().clone();
  light.setTo(20, where);
  std::mt19937_64 random(scene * kViews + static_cast<size_t>(view));
  return Expose(light, 1.02, 1.5, random);
}

// Per scene and view; made once.
const std::vector<std::vector<cv::Mat>>& ThePictures() {
  static const std::vector<std::vector<cv::Mat>> pictures = [] {
    std::vector<std::vector<cv::Mat>> made(kScenesPerKind);
    for (size_t scene = 0; scene < made.size(); ++scene) {
      for (int view = 0; view < kViews; ++view) made[scene].push_back(PictureOf(scene, view));
    }
    return made;
  }();
  return pictures;
}

std::vector<JointPosition> JointsOf(size_t scene) {
  std::vector<JointPosition> joints;
  for (size_t joint = 0; joint < TheScene(scene).robot.size(); ++joint) {
    joints.push_back({GridOf1M().joints()[joint].name, TheScene(scene).robot[joint]});
  }
  return joints;
}

class PictureCameras : public CameraRig {
 public:
  explicit PictureCameras(size_t scene) : pictures_(ThePictures()[scene]) {
    for (int view = 0; view < kViews; ++view) names_.push_back(ViewName(view));
  }
  const std::vector<std::string>& views() const override { return names_; }
  absl::StatusOr<std::vector<CameraImage>> Grab() override {
    std::vector<CameraImage> images;
    ++taken_;
    for (const cv::Mat& picture : pictures_) {
      images.push_back({.width = picture.cols,
                        .height = picture.rows,
                        .channels = 1,
                        .pixels = {picture.datastart, picture.dataend},
                        .captured = absl::Now()});
      // No image twice.
      std::memcpy(images.back().pixels.data(), &taken_, sizeof taken_);
    }
    return images;
  }

 private:
  const std::vector<cv::Mat>& pictures_;
  uint64_t taken_ = 0;
  std::vector<std::string> names_;
};

class StandingRobot : public Robot {
 public:
  explicit StandingRobot(size_t scene) {
    for (const JointPosition& joint : JointsOf(scene)) {
      names_.push_back(joint.name);
      positions_.push_back(joint.position);
    }
  }
  const std::vector<std::string>& joints() const override { return names_; }
  absl::Status MoveTo(std::span<const double>) override { return absl::OkStatus(); }
  absl::StatusOr<RobotState> State() override { return RobotState{.positions = positions_}; }
  absl::Status Stop() override { return absl::OkStatus(); }

 private:
  std::vector<std::string> names_;
  std::vector<double> positions_;
};

// A server that takes images itself until it has made so many maps of a scene.
LiveStatus RunServer(size_t scene, uint64_t maps) {
  const auto& database = TheCellOf1M().database;
  std::vector<std::string> views;
  for (int view = 0; view < kViews; ++view) views.push_back(ViewName(view));
  LiveConfig config;
  config.live.interval = absl::Milliseconds(40);
  config.live.life.least_noise = 0;  // the pictures are still
  const auto record = std::make_shared<LiveRecord>(views, config.scene.max_age, SystemClock);
  ServingSettings settings;
  settings.live = record;
  auto server = Server::Start("unix:" + TestFolder().string() + "/live", database, settings);
  if (!server.ok()) throw std::runtime_error(std::string(server.status().message()));
  const auto loop = LiveLoop::Start(
      config,
      {.open_cameras = [&] { return std::make_unique<PictureCameras>(scene); },
       .open_robot = [&] { return std::make_unique<StandingRobot>(scene); }},
      {.database = [&] { return (*server)->database(); },
       .publish = [&](Scene made,
                      const auto& with) { return (*server)->Publish(std::move(made), with); }},
      record);
  if (!loop.ok()) throw std::runtime_error(std::string(loop.status().message()));
  const absl::Time end = absl::Now() + absl::Minutes(2);
  while (record->Status().to_map.count < maps) {
    if (absl::Now() > end) throw std::runtime_error("no maps: " + Spoken(record->Status()));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return record->Status();
}

// Latencies over all scenes: those of the scenes' medians, and the worst 99th percentile.
void Live(benchmark::State& state) {
  ThePictures();
  Samples masks;
  Samples scenes;
  Samples maps;
  double p99 = 0;
  for (auto _ : state) {
    for (size_t scene = 0; scene < kScenesPerKind; ++scene) {
      LiveStatus status;
      try {
        status = RunServer(scene, 60);
      } catch (const std::runtime_error& error) {
        return state.SkipWithError(error.what());
      }
      masks.Add(absl::ToDoubleNanoseconds(status.to_masks.median));
      scenes.Add(absl::ToDoubleNanoseconds(status.to_scene.median));
      maps.Add(absl::ToDoubleNanoseconds(status.to_map.median));
      p99 = std::max(p99, absl::ToDoubleNanoseconds(status.to_map.p99));
    }
    state.SetIterationTime(maps.Quantile(0.5) * 1e-9);
  }
  state.counters["to_masks_ns"] = masks.Quantile(0.5);
  state.counters["to_scene_ns"] = scenes.Quantile(0.5);
  state.counters["median_ns"] = maps.Quantile(0.5);
  state.counters["p99_ns"] = p99;
}

// The same in one thread, nothing between.
void LiveInTurn(benchmark::State& state) {
  ThePictures();
  const auto& database = TheCellOf1M().database;
  MeasureScenes(state, kScenesPerKind, Caches::kWarm, [&](size_t scene) {
    SceneInput input{.joints = JointsOf(scene), .views = {}};
    for (int view = 0; view < kViews; ++view) {
      input.views.push_back(
          {.view = ViewName(view),
           .captured = std::nullopt,
           .image = SceneMask{Difference(ThePictures()[scene][static_cast<size_t>(view)],
                                         database->reference(view), {}, {64, 64})}});
    }
    auto made = silhouette::MakeScene(*database, input, {}, {}, SystemClock());
    if (!made.ok()) throw std::runtime_error(std::string(made.status().message()));
    const ConfigurationSpace space({.database = database,
                                    .scene = std::make_shared<const Scene>(*std::move(made)),
                                    .without_scene = Reason::kNone},
                                   Policy{});
    for (uint64_t tile = 0; tile < space.tiles(); ++tile) space.tile(tile);
  });
}

BENCHMARK(LiveInTurn)->Name("live_in_turn")->UseManualTime();
BENCHMARK(Live)->Name("live_latency")->UseManualTime()->Iterations(1);

}  // namespace
}  // namespace silhouette::benchmarks
