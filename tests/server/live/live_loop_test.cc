// SPDX-License-Identifier: Apache-2.0
// The loop with devices that work.
#include "server/live/live_loop.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <memory>

#include "tests/server/live/live_cell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

struct LiveLoopTest : LiveCellTest {};

TEST_F(LiveLoopTest, ImagesAndJointsBecomeScenesAgainAndAgain) {
  ASSERT_TRUE(Start().ok());
  const SharedScene first = GoodScene();
  EXPECT_GT(FreeBy(first), 0);
  const SharedScene later =
      NextScene("three more scenes", [&](const Scene& scene) { return scene.id >= first->id + 3; });
  EXPECT_GT(later->oldest.running, first->oldest.running);
  EXPECT_TRUE(record->Status().serving);
  EXPECT_GE(record->Status().to_scene.count, 3u);
}

std::shared_ptr<const ServedDatabase> WithTools() {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.references = true});
  AddTools(folder / "db");
  return LoadDatabase(folder / "db");
}

TEST_F(LiveLoopTest, WhichOfSeveralVariantsShowsTheRobotIsNotGuessed) {
  scenes.ReplaceDatabase(WithTools());
  ASSERT_TRUE(Start().ok());
  const SharedScene scene =
      SceneWithDefect(Reason::kVariantUnknown, "the robot's variant is not known");
  EXPECT_EQ(FreeBy(scene), 0);
  EXPECT_EQ(scene->variant, "");
  EXPECT_EQ(scene->views.size(), 3u) << "what cameras saw is told all the same";
  EXPECT_TRUE(record->Status().serving);
  Tell("default");
  EXPECT_EQ(GoodScene()->variant, "default");
}

TEST_F(LiveLoopTest, DatabaseThatGetsASecondVariantHasToBeTold) {
  ASSERT_TRUE(Start().ok());
  EXPECT_EQ(GoodScene()->variant, "default");
  const auto both = WithTools();
  record->NoteVariants(both->variants());
  scenes.ReplaceDatabase(both);
  SceneWithDefect(Reason::kVariantUnknown, "the robot's variant is not known");
}

TEST_F(LiveLoopTest, VariantOfTheStartIsThatOfTheFirstScene) {
  scenes.ReplaceDatabase(WithTools());
  config.live.variant = kTool;
  Script([](LiveScript& to) { to.tool = true; });
  ASSERT_TRUE(Start().ok());
  const SharedScene first = NextScene("any", [](const Scene&) { return true; });
  EXPECT_EQ(first->variant, kTool);
  EXPECT_EQ(GoodScene()->obstacle_images[0]->obstacle().Count(), 0u) << "the tool is no obstacle";
  loop.reset();
  config.live.variant = "none";
  const absl::Status refused = Start();
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("'none'; it has default, tool"));
}

// The images show the tool, or do not, from the instant on at which that is told.
TEST_F(LiveLoopTest, ScenesHaveTheVariantThatShowsTheRobotOrNone) {
  scenes.ReplaceDatabase(WithTools());
  config.live.variant = "default";
  ASSERT_TRUE(Start().ok());
  GoodScene();
  for (const bool tool : {true, false, true}) {
    Tell("");
    const SharedScene changing = Newest();
    EXPECT_EQ(FreeBy(changing), 0);
    SceneWithDefect(Reason::kVariantUnknown, "being changed");
    Script([&](LiveScript& to) { to.tool = tool; });
    const absl::Time told = absl::Now();
    Tell(tool ? kTool : "default");
    const uint64_t last = scenes.last_withdrawn();
    const SharedScene good = GoodScene();
    EXPECT_EQ(good->variant, tool ? kTool : "default");
    EXPECT_GT(good->id, last);
    EXPECT_GE(good->oldest.time, told + kClockTolerance);
    EXPECT_EQ(good->obstacle_images[0]->obstacle().Count(), 0u);
    for (uint64_t id = changing->id; id < good->id; ++id) {
      const SharedScene between = scenes.Find(id);
      if (between == nullptr) continue;
      // On a busy machine scenes may be good before the one that this test waits for.
      if (between->oldest.time >= told + kClockTolerance) continue;
      EXPECT_EQ(between->Blocked(), Reason::kVariantUnknown) << id;
    }
  }
}

TEST_F(LiveLoopTest, CameraWhoseClockIsAheadGivesNoNewVariantToAnOldImage) {
  scenes.ReplaceDatabase(WithTools());
  config.live.variant = "default";
  Script([](LiveScript& to) { to.stamps.assign(3, absl::Milliseconds(90)); });
  ASSERT_TRUE(Start().ok());
  GoodScene();
  const absl::Time told = absl::Now();
  Tell(kTool);
  Script([](LiveScript& to) { to.tool = true; });
  const SharedScene first =
      NextScene("one of the tool", [](const Scene& scene) { return scene.variant == kTool; });
  EXPECT_GE(first->oldest.time - absl::Milliseconds(90), told) << "by a clock that is right";
}

TEST_F(LiveLoopTest, StampAheadOfItsArrivalFindsTheRobotsJoints) {
  config.live.joints_gap = absl::Milliseconds(60);
  Script([](LiveScript& to) { to.stamps.assign(3, absl::Milliseconds(90)); });
  ASSERT_TRUE(Start().ok());
  GoodScene();
}

TEST_F(LiveLoopTest, WhatStandsInTheCellIsInTheNextScene) {
  ASSERT_TRUE(Start().ok());
  EXPECT_TRUE(CheckerNow(GoodScene()).Check(At(3, 0)).free());
  Script([](LiveScript& to) { to.blocks = {3, 3, 3}; });
  const SharedScene blocked = NextScene("a scene with the block", [](const Scene& scene) {
    return scene.obstacle_images[0] && scene.obstacle_images[0]->obstacle().Count() > 0;
  });
  EXPECT_EQ(CheckerNow(blocked).Check(At(3, 0)).state(), State::kOccupied);
}

// A mask pixel beside the robot, dark in the last `dark` of each `period` images.
constexpr int kRimView = 1;
constexpr int kRimX = 2;
const int kRimY = kViewSizes[kRimView].height - 2;
void DarkenRim(LiveScript& script, int dark, int period) {
  script.change = [&script, dark, period](std::vector<absl::StatusOr<CameraImage>>& images) {
    if ((script.grabs - 1) % period < period - dark) return;
    CameraImage& image = *images[2];  // of kRimView
    for (int row = kRimY * kScale; row < (kRimY + 1) * kScale; ++row) {
      std::fill_n(image.pixels.begin() + row * image.width + kRimX * kScale, kScale, uint8_t{20});
    }
  };
}

bool ShowsRim(const Scene& scene) {
  return scene.views[kRimView] && scene.views[kRimView]->foreground.at(kRimX, kRimY);
}

TEST_F(LiveLoopTest, PixelBesideTheRobotIsAnObstacleIfItLasts) {
  Script([](LiveScript& to) { DarkenRim(to, 2, 3); });
  config.live.evidence_gap = absl::Hours(1);
  ASSERT_TRUE(Start().ok());
  uint64_t newest = 0;
  for (int i = 0; i < 5; ++i) {
    const SharedScene scene = NextScene("a scene with the pixel", [&](const Scene& next) {
      return next.id > newest && ShowsRim(next);
    });
    EXPECT_TRUE(scene->obstacle_images[kRimView]->obstacle().Empty());
    EXPECT_TRUE(scene->obstacle_images[kRimView]->unknown().at(kRimX, kRimY));
    newest = scene->id;
  }
  Script([](LiveScript& to) { DarkenRim(to, 1, 1); });
  NextScene("a scene with the obstacle", [&](const Scene& scene) {
    return ShowsRim(scene) && scene.obstacle_images[kRimView]->obstacle().at(kRimX, kRimY);
  });
}

TEST_F(LiveLoopTest, PixelBesideTheRobotIsAnObstacleAtOnceIfTheImageBeforeIsTooOld) {
  Script([](LiveScript& to) { DarkenRim(to, 1, 2); });
  config.live.evidence_gap = -absl::InfiniteDuration();
  ASSERT_TRUE(Start().ok());
  const SharedScene scene = NextScene("a scene with the pixel", ShowsRim);
  EXPECT_TRUE(scene->obstacle_images[kRimView]->obstacle().at(kRimX, kRimY));
}

TEST_F(LiveLoopTest, RobotIsWhereItSaysWhateverTheOrderOfItsJoints) {
  Script([](LiveScript& to) {
    to.robot_a = 2;
    to.joints = {0.5, At(2, 0)[1], At(2, 0)[0]};
  });
  ASSERT_TRUE(Start().ok());
  const SharedScene scene = GoodScene();
  EXPECT_NEAR(scene->joints[0].position, At(2, 0)[0], 1e-12);
  EXPECT_EQ(scene->obstacle_images[0]->obstacle().Count(), 0u) << "the robot is no obstacle";
}

TEST_F(LiveLoopTest, MapIsCountedFromTheArrivalOfTheImages) {
  ASSERT_TRUE(Start().ok());
  record->NoteMap(GoodScene()->arrived);
  EXPECT_EQ(record->Status().to_map.count, 1u);
  EXPECT_GT(record->Status().to_map.median, absl::ZeroDuration());
}

TEST_F(LiveLoopTest, SameImagesAgainAreNoNewScene) {
  ASSERT_TRUE(Start().ok());
  GoodScene();
  Script([](LiveScript& to) {
    to.change = [taken = absl::Now()](auto& images) {
      for (auto& image : images) image->captured = taken;
    };
  });
  const auto sets = [&] { return record->Status().cameras[0].good; };
  const uint64_t before = sets();
  WaitUntil([&] { return sets() >= before + 3; }, "three more sets");
  const uint64_t id = Newest()->id;
  WaitUntil([&] { return sets() >= before + 6; }, "six more sets");
  EXPECT_EQ(Newest()->id, id);
}

TEST_F(LiveLoopTest, WallClockThatIsSetCostsAtMostOneSet) {
  // Set while a set of images is on its way: by then they have their stamps.
  const auto set = std::make_shared<std::atomic<double>>(0);
  const auto to_set = std::make_shared<std::atomic<double>>(0);
  config.clock = [set] {
    Moment now = SystemClock();
    now.time += absl::Seconds(set->load());
    return now;
  };
  Script([=](LiveScript& to) {
    to.change = [=](auto& images) {
      for (auto& image : images) image->captured += absl::Seconds(set->load());
      *set = *set + to_set->exchange(0);
    };
  });
  ASSERT_TRUE(Start().ok());
  GoodScene();
  uint64_t errors = 0;
  for (const double step : {-60.0, 60.0, -5.0, 5.0}) {
    const absl::Duration before = SystemClock().running;
    *to_set = step;
    const SharedScene scene = NextScene("a scene after it", [&](const Scene& made) {
      return *to_set == 0 && made.oldest.running > before && made.defects.empty();
    });
    EXPECT_LE(scene->oldest.running, scene->arrived.running);
    EXPECT_TRUE(record->Status().serving) << step;
    for (const DeviceStatus& camera : record->Status().cameras) {
      EXPECT_LE(camera.errors, errors + 1) << step;
    }
    errors = record->Status().cameras[0].errors;
  }
}

TEST_F(LiveLoopTest, AnotherDatabaseIsServedFromTheNextSetOn) {
  ASSERT_TRUE(Start().ok());
  const uint64_t id = GoodScene()->id;
  const auto other = NewDatabase({.missing = {{1, 1}}, .references = true});
  scenes.ReplaceDatabase(other);
  const SharedScene scene =
      NextScene("a scene of it", [&](const Scene& made) { return made.id > id; });
  EXPECT_EQ(scene->generation, other->generation());
}

// With camera images that are large enough to learn the light of.
struct LearntLightTest : LiveCellTest {
  LearntLightTest() {
    for (storage::v1::View& view : *cell.mutable_views()) {
      view.set_image_width(160);
      view.set_image_height(120);
      config.without_noise.insert(view.name());
    }
    record = std::make_shared<LiveRecord>(kViewNames, config.scene.max_age, config.clock);
  }

  // The cell, brighter towards the right by `slope`.
  static cv::Mat Picture(double slope) {
    cv::Mat image(120, 160, CV_8UC1);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        image.at<uint8_t>(y, x) = static_cast<uint8_t>((120 + (x * 7 + y * 13) % 60) *
                                                       (1 + slope * (2.0 * x / image.cols - 1)));
      }
    }
    return image;
  }
  std::shared_ptr<const ServedDatabase> DatabaseWith(
      const cv::Mat& empty, std::vector<std::pair<int, int>> missing = {}) const {
    storage::v1::References references;
    for (int view = 0; view < 3; ++view) {
      const Reference reference = Reference::FromImages(std::vector<cv::Mat>(4, empty));
      storage::v1::Reference& stored = *references.add_views();
      stored.set_mean_png(reference.MeanPng());
      stored.set_noise_png(reference.NoisePng());
      stored.set_images(4);
    }
    const std::filesystem::path folder = FreshFolder();
    MakeDatabase(folder / "db", {.missing = std::move(missing), .cell = cell});
    {
      const auto made = Database::Open(folder / "db", Database::Access::kWrite);
      EXPECT_TRUE((*made)->SetReferences(references, "test").ok());
    }
    return LoadDatabase(folder / "db");
  }
  Acquisition NewAcquisition() {
    return {config,
            {.database = [this] { return served; },
             .publish = [this](Scene scene, const auto&) -> absl::StatusOr<SharedScene> {
               foreground = 0;
               for (const auto& view : scene.views) foreground += view->foreground.Count();
               return std::make_shared<const Scene>(std::move(scene));
             }},
            [](absl::Duration, absl::Duration) {
              return absl::StatusOr<std::vector<JointPosition>>(absl::UnavailableError("no robot"));
            },
            record,
            cell};
  }
  // The foreground of the scene that all views see ten seconds later, in mask pixels.
  size_t Take(Acquisition& acquisition, const cv::Mat& pixels) {
    now.time += absl::Seconds(10);
    now.running += absl::Seconds(10);
    const CameraImage image{.width = pixels.cols,
                            .height = pixels.rows,
                            .channels = 1,
                            .pixels = {pixels.datastart, pixels.dataend},
                            .captured = now.time};
    const std::vector<absl::StatusOr<CameraImage>> images(3, image);
    EXPECT_TRUE(acquisition.Take({.images = images, .asked = now, .arrived = now}).ok());
    return foreground;
  }

  storage::v1::CellDescription cell = ServerTestCell();
  std::shared_ptr<const ServedDatabase> served;
  Moment now = SystemClock();
  size_t foreground = 0;  // of the newest scene
};

TEST_F(LearntLightTest, OutlastsAnotherDatabaseUnlessItsReferencesAreOthers) {
  served = DatabaseWith(Picture(0));
  Acquisition acquisition = NewAcquisition();
  for (int i = 0; i < 60; ++i) Take(acquisition, Picture(0.2 * i / 60));
  EXPECT_EQ(Take(acquisition, Picture(0.2)), 0u);
  served = DatabaseWith(Picture(0), {{1, 1}});
  EXPECT_EQ(Take(acquisition, Picture(0.2)), 0u);
  Acquisition later = NewAcquisition();
  EXPECT_GT(Take(later, Picture(0.2)), 0u) << "it has not seen how the light changed";
  served = DatabaseWith(Picture(0) + 1);
  EXPECT_GT(Take(acquisition, Picture(0.2)), 0u) << "since this reference it has not, either";
}

TEST_F(LearntLightTest, ShadowThatIsIgnoredTeachesNothing) {
  served = DatabaseWith(Picture(0));
  cv::Mat shaded = Picture(0);
  shaded(cv::Rect(50, 30, 60, 50)) *= 0.7;
  Acquisition counting = NewAcquisition();
  const size_t counted = Take(counting, shaded);
  config.segmentation.shadows = Shadows::kIgnore;
  Acquisition ignoring = NewAcquisition();
  ASSERT_LT(Take(ignoring, shaded), counted);
  for (int i = 0; i < 60; ++i) Take(ignoring, shaded);
  EXPECT_EQ(Take(ignoring, Picture(0)), 0u);
}

TEST_F(LiveLoopTest, DatabaseWithoutReferencesStopsScenesUntilThereIsOneWithThem) {
  ASSERT_TRUE(Start().ok());
  GoodScene();
  scenes.ReplaceDatabase(NewDatabase({.references = false}));
  WaitUntil([&] { return record->Status().fault.find("no reference") != std::string::npos; },
            "a fault of the database");
  EXPECT_EQ(Newest(), nullptr);
  scenes.ReplaceDatabase(database);
  EXPECT_GT(FreeBy(GoodScene()), 0);
}

TEST_F(LiveLoopTest, ReferencesAreNeededFromTheStart) {
  scenes.ReplaceDatabase(NewDatabase({.references = false}));
  const absl::Status started = Start();
  EXPECT_EQ(started.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(started.message()), HasSubstr("silhouette-capture reference"));
}

TEST_F(LiveLoopTest, DevicesThatDoNotFitTheCellAreToldAtTheStart) {
  struct OtherRobot : ScriptedRobot {
    using ScriptedRobot::ScriptedRobot;
    const std::vector<std::string>& joints() const override { return names; }
    const std::vector<std::string> names = {"lift", "b", "c"};
  };
  LiveDevices devices = Devices();
  devices.open_robot = [this] { return std::make_unique<OtherRobot>(script); };
  record = std::make_shared<LiveRecord>(kViewNames, config.scene.max_age, config.clock);
  const auto started = LiveLoop::Start(
      config, devices, {.database = [this] { return scenes.database(); }, .publish = nullptr},
      record);
  EXPECT_EQ(started.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(started.status().message()), HasSubstr("no joint 'a'"));
}

}  // namespace
}  // namespace silhouette
