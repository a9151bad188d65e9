// SPDX-License-Identifier: Apache-2.0
// Databases whose robot images are drawn: scenes, the sound presets, what verdicts rest on.
#include <gmock/gmock.h>

#include <cmath>

#include "calib/robot/drawn_digest.h"
#include "server/scene/checker.h"
#include "tests/server/scene/drawn_scene.h"
#include "tests/server/test_cell.h"
#include "tests/server/tool_variant.h"

namespace silhouette {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

TEST(SoundCell, VoxelsAreAnEighthOfTheLeastObstacleUnlessThatAreTooMany) {
  SoundCell cell{.settings = {.least_obstacle = 0.16, .voxel_edge = {}},
                 .workspace = Eigen::AlignedBox3d(Vector3d(-1, -1, 0), Vector3d(1, 1, 2)),
                 .payload_radius = 0,
                 .robot = nullptr};
  EXPECT_DOUBLE_EQ(cell.VoxelEdge(), 0.02);
  cell.settings.least_obstacle = 0.05;
  EXPECT_DOUBLE_EQ(cell.VoxelEdge(), std::cbrt(8 / 1.6e7));
  cell.settings.least_obstacle = 0.02;
  EXPECT_DOUBLE_EQ(cell.VoxelEdge(), 0.02 / 3);
  cell.settings.voxel_edge = 0.01;
  EXPECT_EQ(cell.VoxelEdge(), 0.01);
}

TEST_F(DrawnSoundTest, RobotThatTouchesAnObstacleIsNeverFreeUnderSoundAtAnyConfiguration) {
  size_t touching = 0;
  size_t free[2] = {0, 0};
  for (int scene = 0; scene < 8; ++scene) {
    const Configuration now = Any();
    const std::vector<DrawnCellBall> balls = SomeBalls(now, 0.09);
    const Served served = ServedScene(InputOf(now, balls));
    for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
      const Checker checker(served, {.preset = preset}, settings, kDrawnNow);
      for (int i = 0; i < 100; ++i) {
        const Configuration q = Any();
        const Verdict verdict = checker.Check(q);
        const bool touches = Touches(q, balls);
        ASSERT_FALSE(touches && verdict.free()) << NameOf(preset) << ", scene " << scene;
        touching += touches ? 1 : 0;
        free[preset == Preset::kSound ? 1 : 0] += verdict.free() ? 1 : 0;
      }
    }
  }
  RecordProperty("free_of_800_under_sound_planes", static_cast<int>(free[0]));
  RecordProperty("free_of_800_under_sound", static_cast<int>(free[1]));
  EXPECT_GT(touching, 30u);
  EXPECT_GT(free[1], 200u);
}

TEST_F(DrawnSoundTest, RobotThatLeavesItsWorkspaceIsUnknownUnderSoundOnMotionsToo) {
  sound->workspace.max() = Vector3d(1.1, 0.6, 1.1);
  sound->robot_may_leave = true;
  auto loaded = Load({.calibration = calibration, .drawn = cell});
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  database = *loaded;
  const auto leaves = [&](const Configuration& q) {
    const std::vector<Eigen::Isometry3d> poses =
        model->LinkPoses(std::vector<double>{q[0], q[1], 0.1});
    for (size_t link = 1; link < poses.size(); ++link) {
      const LinkGeometry& geometry = model->links()[link].visual[0];
      const Vector3d half = std::get<BoxShape>(geometry.shape).size / 2;
      for (int corner = 0; corner < 8; ++corner) {
        const Vector3d at(corner & 1 ? half.x() : -half.x(), corner & 2 ? half.y() : -half.y(),
                          corner & 4 ? half.z() : -half.z());
        if (!sound->workspace.contains(poses[link] * geometry.link_from_shape * at)) return true;
      }
    }
    return false;
  };
  size_t outside = 0;
  size_t free = 0;
  for (int scene = 0; scene < 20; ++scene) {
    const Preset preset = scene % 2 == 0 ? Preset::kSoundPlanes : Preset::kSound;
    const Checker checker = CheckerOf(InputOf(Any(), {}), {.preset = preset});
    for (int i = 0; i < 30; ++i) {
      const Configuration q = Any();
      const Verdict verdict = checker.Check(q);
      ASSERT_FALSE(verdict.free() && leaves(q)) << NameOf(preset);
      outside += verdict == Verdict::Unknown(Reason::kOutsideWorkspace) ? 1 : 0;
      free += verdict.free() ? 1 : 0;
      const std::vector<Configuration> path = {q, Any()};
      const PathVerdict motion =
          checker.CheckPath(path, {}, nullptr, nullptr, {.resolution = 0.02});
      for (int step = 0; motion.verdict.free() && step <= 100; ++step) {
        ASSERT_FALSE(leaves({std::lerp(q[0], path[1][0], step / 100.0),
                             std::lerp(q[1], path[1][1], step / 100.0)}));
      }
    }
  }
  EXPECT_GT(outside, 50u);
  EXPECT_GT(free, 50u);
}

TEST_F(DrawnSoundTest, NoFreeMotionTouchesAnObstacleUnderSound) {
  size_t free = 0;
  for (int scene = 0; scene < 6; ++scene) {
    const Configuration now = Any();
    const std::vector<DrawnCellBall> balls = SomeBalls(now, 0.09);
    const Checker checker = CheckerOf(InputOf(now, balls), {.preset = Preset::kSound});
    for (int i = 0; i < 12; ++i) {
      // Every other one begins where the robot stands.
      const std::vector<Configuration> path = {i % 2 == 0 ? now : Any(), Any()};
      const PathVerdict verdict =
          checker.CheckPath(path, {}, nullptr, nullptr, {.resolution = 0.02});
      if (!verdict.verdict.free()) continue;
      ++free;
      ASSERT_EQ(verdict.sampled_step, 0) << "all of it is proven";
      for (int step = 0; step <= 400; ++step) {
        Configuration q = path[0];
        for (size_t j = 0; j < 2; ++j) q[j] += step / 400.0 * (path[1][j] - path[0][j]);
        ASSERT_FALSE(Touches(q, balls));
      }
    }
  }
  EXPECT_GT(free, 10u);
}

TEST_F(DrawnSoundTest, UnderSoundMotionThatIsOnlySampledIsUnknown) {
  size_t unproven = 0;
  size_t proven_finer = 0;
  for (const Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
    for (int scene = 0; scene < 6; ++scene) {
      const Configuration now = Any();
      const std::vector<DrawnCellBall> balls = SomeBalls(now, 0.09);
      const Checker checker = CheckerOf(InputOf(now, balls), {.preset = preset});
      for (int i = 0; i < 20; ++i) {
        const std::vector<Configuration> path = {Any(), Any()};
        std::vector<ViewEvidence> evidence(4);
        const PathVerdict coarse =
            checker.CheckPath(path, evidence, nullptr, nullptr, {.resolution = 0.1});
        EXPECT_EQ(coarse.sampled_step, 0);
        if (coarse.verdict != Verdict::Unknown(Reason::kMotionNotProven)) continue;
        ++unproven;
        EXPECT_TRUE(checker.Check(coarse.configuration).free()) << "what is there, was looked at";
        for (size_t j = 0; j < 2; ++j) {
          const double at = path[static_cast<size_t>(coarse.segment)][j];
          EXPECT_NEAR(coarse.configuration[j], std::lerp(at, path[1][j], coarse.fraction), 1e-9);
        }
        const PathVerdict fine =
            checker.CheckPath(path, {}, nullptr, nullptr, {.resolution = 0.001});
        proven_finer += fine.verdict.free() ? 1 : 0;
      }
    }
  }
  EXPECT_GT(unproven, 5u);
  EXPECT_GT(proven_finer, 0u);
}

TEST_F(DrawnSoundTest, MotionIsNotFreeForItsEndsAndMiddleAlone) {
  size_t met = 0;
  for (int scene = 0; scene < 6; ++scene) {
    const Configuration now = Any();
    const std::vector<DrawnCellBall> balls = SomeBalls(now, 0.09);
    const Checker checker = CheckerOf(InputOf(now, balls), {.preset = Preset::kSound});
    for (int i = 0; i < 150; ++i) {
      const std::vector<Configuration> path = {Any(), Any()};
      const auto at = [&](double place) {
        return Configuration{std::lerp(path[0][0], path[1][0], place),
                             std::lerp(path[0][1], path[1][1], place)};
      };
      bool touches = false;
      for (int step = 1; step < 32; ++step) touches = touches || Touches(at(step / 32.0), balls);
      if (!touches) continue;
      if (!checker.Check(path[0]).free() || !checker.Check(path[1]).free()) continue;
      if (!checker.Check(at(0.5)).free()) continue;
      ++met;
      ASSERT_FALSE(
          checker.CheckPath(path, {}, nullptr, nullptr, {.resolution = 0.05}).verdict.free());
    }
  }
  EXPECT_GT(met, 3u);
}

TEST_F(DrawnSoundTest, EveryPresetAnswersAtAnyConfigurationAndExplains) {
  const Configuration now = {0.123, 0.456};
  const Served served = ServedScene(InputOf(now, {{{-0.7, 0.2, 0.9}, 0.1}}));
  EXPECT_TRUE(served.scene->defects.empty()) << served.scene->defects[0].message;
  for (const Preset preset : AllPresets()) {
    const Checker checker(served, {.preset = preset}, settings, kDrawnNow);
    const Configuration q = {0.3, 0.2};
    std::vector<ViewEvidence> evidence(4);
    EXPECT_EQ(checker.Check(q, evidence), checker.Check(q)) << NameOf(preset);
    EXPECT_NE(checker.Check(q).state(), State::kUnknown) << NameOf(preset);
    EXPECT_GT(evidence[0].unknown_pixels, 0u);
    EXPECT_EQ(checker.TestRobotImages(q), database->robot_images().drawn()->Touched(q));
    for (int view = 0; view < 4; ++view) {
      EXPECT_TRUE(checker.CollisionImagesAt(q)[static_cast<size_t>(view)]);
    }
    EXPECT_EQ(checker.Check(Configuration{0, 2.1}), Verdict::Unknown(Reason::kOutsideGrid));
    const auto meter = checker.Clearances();
    ASSERT_TRUE(meter);
    EXPECT_TRUE(meter->Measure(q, checker.Check(q)));
  }
}

TEST_F(DrawnSceneTest, UnknownAndErrorPixelsAreDrawnAtTheJointsOfTheScene) {
  const Configuration now = {0.123, 0.456};
  SceneInput input = InputOf(now, {});
  const Served served = ServedScene(input);
  const std::vector<Mask> touched = database->robot_images().drawn()->Touched(now);
  for (size_t view = 0; view < 4; ++view) {
    const ObstacleImage& image = *served.scene->obstacle_images[view];
    EXPECT_TRUE(image.obstacle().Empty());
    EXPECT_TRUE(image.error().Empty());
    EXPECT_TRUE((image.unknown() - touched[view]).Empty());
    input.views[view].image = SceneMask{Mask(kDrawnSize)};
  }
  SceneSettings lenient;
  lenient.max_core_error = 1;
  const auto without = MakeScene(*database, input, lenient, {}, kDrawnNow);
  ASSERT_TRUE(without.ok()) << without.status();
  for (size_t view = 0; view < 4; ++view) {
    const Mask& error = without->obstacle_images[view]->error();
    EXPECT_EQ(error, touched[view] & database->robot_images().drawn()->Covered(now)[view]);
    EXPECT_FALSE(error.Empty());
  }
}

TEST_F(DrawnSoundTest, RobotThatIsNotWhereItsModelCanBeIsNeverFree) {
  const std::vector<std::vector<JointPosition>> wrong = {
      {{"turn", 0}, {"lift", 2.1}, {"reach", 0.1}},
      {{"turn", 0}, {"reach", 0.1}},
      {{"lift", 0}, {"reach", 0.1}},
      {{"turn", 0}, {"lift", 0}},
      {{"turn", 0}, {"lift", 0}, {"reach", 0.11}}};
  for (const std::vector<JointPosition>& joints : wrong) {
    SceneInput input = InputOf({0, 0}, {});
    input.joints = joints;
    for (const Preset preset : AllPresets()) {
      const Checker checker = CheckerOf(input, {.preset = preset});
      EXPECT_EQ(checker.Check(Configuration{1, 0}).state(), State::kUnknown);
      EXPECT_FALSE(checker.CheckPath(std::vector<Configuration>{{1, 0}, {1.2, 0}}).verdict.free());
    }
  }
}

TEST_F(DrawnSoundTest, AllVerdictsRestOnTheCalibration) {
  Served served = ServedScene(InputOf({0, 0}, {}));
  EXPECT_TRUE(Checker(served, {}, settings, kDrawnNow).Check(Configuration{1, 0}).free());
  served.trust = std::make_shared<const CalibrationTrust>();
  for (const Preset preset : AllPresets()) {
    const Checker checker(served, {.preset = preset}, settings, kDrawnNow);
    EXPECT_EQ(checker.Check(Configuration{1, 0}), Verdict::Unknown(Reason::kCalibrationDoubtful));
  }
}

TEST_F(DrawnSceneTest, ItsMapIsDrawnAndHasNoFreeCells) {
  const Served served = ServedScene(InputOf({0, 0}, {}));
  const ConfigurationSpace space(served, {});
  EXPECT_FALSE(space.looked_up(0));
  EXPECT_EQ(space.state(database->grid().NumberOf({1, 0})), State::kFree);
  EXPECT_EQ(space.state(database->grid().number_limit() - 1), State::kUnknown);
  const std::vector<uint64_t> tiles = {0};
  EXPECT_TRUE(space.WorkOutCells(tiles, [] { return false; }));
  EXPECT_TRUE(space.cells_ready(0));
  EXPECT_TRUE(space.free_cells(0).Empty());
  EXPECT_FALSE(space.cells_exact());
}

TEST_F(DrawnSceneTest, MapThatIsGivenUpGoesOnFromThere) {
  const Served served = ServedScene(InputOf({0, 0}, {{{0.6, 0, 0.8}, 0.1}}));
  const ConfigurationSpace whole(served, {});
  const ConfigurationSpace space(served, {});
  const std::vector<uint64_t> tiles = {0};
  for (const int most : {0, 1, 4}) {
    int asked = 0;
    EXPECT_FALSE(space.WorkOut(tiles, [&] { return ++asked > most; }));
    EXPECT_EQ(asked, most + 1) << "a configuration at a time";
    EXPECT_FALSE(space.ready(0));
  }
  const std::vector<uint32_t> numbers = {0, 1};
  std::vector<uint64_t> bits(1);
  std::vector<uint64_t> others(1);
  EXPECT_FALSE(space.States(numbers, bits, others, [] { return true; }));
  EXPECT_TRUE(space.WorkOut(tiles, nullptr));
  EXPECT_EQ(space.tile(0), whole.tile(0));
  EXPECT_TRUE(space.WorkOut(tiles, [] { return true; })) << "nothing is left to do";

  const auto verdicts = std::make_shared<const ConfigurationSpace>(served, Policy());
  const ClearanceSpace levels(verdicts, served, {}, {1.0});
  EXPECT_FALSE(levels.WorkOut(tiles, [] { return true; }));
  int asked = 0;
  EXPECT_FALSE(levels.WorkOut(tiles, [&] { return ++asked > 8; }));
  EXPECT_FALSE(levels.ready(0));
  EXPECT_TRUE(levels.WorkOut(tiles, nullptr));
}

TEST_F(DrawnSceneTest, CapturedImagesAndTheirIndexAreNotLookedAt) {
  {
    const auto opened = Database::Open(folder / "db", Database::Access::kWrite);
    auto writer = (*opened)->Write("test");
    RobotImage image;
    image.number = (*opened)->grid().NumberOf({0, 0});
    image.masks = std::vector<Mask>(4, Mask(kDrawnSize));
    ASSERT_TRUE(writer->Put(image).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  BuildIndex(folder / "db");
  const auto loaded = Load({.calibration = calibration, .drawn = cell});
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_EQ((*loaded)->index(), nullptr);
  EXPECT_EQ((*loaded)->robot_images().Images((*loaded)->grid().NumberOf({0, 0})),
            (*loaded)->robot_images().drawn()->Touched((*loaded)->grid().At(GridIndex{})));
  EXPECT_EQ((*loaded)->robot_images().Count(RobotImageState::kPresent), 6u);
  EXPECT_TRUE((*loaded)->unverified_model());
}

TEST_F(DrawnSceneTest, WithoutCameraModelsOrWithAnotherVariantItIsNotLoaded) {
  const auto without = Load({.drawn = cell});
  EXPECT_TRUE(absl::IsFailedPrecondition(without.status())) << without.status();
  EXPECT_THAT(without.status().message(), HasSubstr("silhouette-db calibration import"));
  {
    const auto opened = Database::Open(folder / "db", Database::Access::kWrite);
    ASSERT_TRUE((*opened)->CreateVariant("tool", "test").ok());
  }
  const auto two = Load({.calibration = calibration, .drawn = cell});
  EXPECT_TRUE(absl::IsFailedPrecondition(two.status())) << two.status();
  EXPECT_THAT(two.status().message(), HasSubstr("'tool'"));
}

TEST_F(DrawnSceneTest, ErrorsOfTheCalibrationWithinItsMarginHideNothingOfTheRobot) {
  margin = 0.8;
  Calibration off;
  for (const CameraModel& camera : calibration.cameras) {
    std::uniform_real_distribution<double> error(-margin, margin);
    CameraIntrinsics in = camera.intrinsics();
    in.cx += error(random);
    in.cy += error(random);
    off.cameras.emplace_back(in, camera.camera_from_world());
  }
  const auto loaded = Load({.calibration = off, .drawn = cell});
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  const DrawnRobot& drawn = *(*loaded)->robot_images().drawn();
  size_t covered = 0;
  for (int i = 0; i < 20; ++i) {
    const Configuration q = Any();
    const std::vector<Mask> seen[2] = {truth->Touched(q), truth->Covered(q)};
    const std::vector<Mask> got[2] = {drawn.Touched(q), drawn.Covered(q)};
    for (size_t view = 0; view < 4; ++view) {
      EXPECT_TRUE((seen[0][view] - got[0][view]).Empty());
      EXPECT_TRUE((got[1][view] - seen[1][view]).Empty());
      covered += got[1][view].Count();
    }
  }
  EXPECT_GT(covered, 1000u);
}

TEST_F(DrawnSceneTest, TolerancePayloadAndLinkGrowthAreDrawn) {
  cell.parts.tolerance = 0.02;
  cell.payload_radius = 0.1;
  const std::vector<std::string> moving = {"turn", "lift"};
  const std::vector<FixedJoint> fixed = {{"reach", 0.1}};
  const std::vector<MaskSize> sizes(4, kDrawnSize);
  const DrawnRobot grown =
      DrawnRobotOf(cell, moving, fixed, calibration, sizes, 0, std::vector<double>{0, 0, 0.03, 0})
          .value();
  ASSERT_EQ(grown.parts().size(), 5u);
  EXPECT_DOUBLE_EQ(grown.parts()[0].radius, 0.02);
  EXPECT_DOUBLE_EQ(grown.parts()[2].radius, 0.05);
  // They slide with the fixed joint, which may stand 5 mm elsewhere.
  EXPECT_DOUBLE_EQ(grown.parts()[3].radius, 0.125);
  EXPECT_DOUBLE_EQ(grown.parts()[4].radius, 0.125);
  EXPECT_EQ(grown.parts()[4].moves_with, 3u);
  for (const std::vector<double>& growth :
       std::vector<std::vector<double>>{{0, 0, 0}, {0, 0, 0, -0.01}, {0, 0, 0, NAN}}) {
    EXPECT_FALSE(DrawnRobotOf(cell, moving, fixed, calibration, sizes, 0, growth).ok());
  }
}

struct VerifiedSceneTest : DrawnSceneTest {
  // As silhouette-capture verify-model stores it.
  storage::v1::ModelVerification Verification() const {
    storage::v1::ModelVerification verification;
    verification.set_digest(DigestOf(*database->robot_images().drawn()));
    for (const RobotLink& link : model->links()) {
      storage::v1::LinkGrowth& growth = *verification.add_link_growth();
      growth.set_link(link.name);
      growth.set_growth(link.name == "tip" ? 0.03 : 0);
    }
    for (const GridJoint& joint : database->grid().joints()) {
      storage::v1::VerifiedRange& range = *verification.add_ranges();
      range.set_joint(joint.name);
      range.set_lower(joint.lower);
      range.set_upper(joint.upper);
    }
    return verification;
  }

  absl::StatusOr<std::shared_ptr<const ServedDatabase>> LoadWith(
      const storage::v1::ModelVerification& verification) {
    {
      const auto opened = Database::Open(folder / "db", Database::Access::kWrite);
      EXPECT_TRUE((*opened)->SetVerification(verification, "test").ok());
    }
    return Load({.calibration = calibration, .drawn = cell});
  }
};

TEST_F(VerifiedSceneTest, GrowthOfAVerifiedModelIsDrawn) {
  const auto loaded = LoadWith(Verification());
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_FALSE((*loaded)->unverified_model());
  const std::vector<RobotPart>& bare = database->robot_images().drawn()->parts();
  const std::vector<RobotPart>& grown = (*loaded)->robot_images().drawn()->parts();
  ASSERT_EQ(grown.size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_DOUBLE_EQ(grown[i].radius, bare[i].radius + (i == 3 ? 0.03 : 0));
  }
}

TEST_F(VerifiedSceneTest, ModelBeyondWhichTheRobotReachesIsNoWholeModel) {
  sound = DrawnSoundCell(model);
  const auto refused = LoadWith(Verification());
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(refused.status().message(), HasSubstr("link 'tip' reaches 3.0 cm beyond the model"));
  sound->settings.whole_model = false;
  EXPECT_TRUE(LoadWith(Verification()).ok());
  sound->settings.whole_model = true;
  sound->settings.model_tolerance = 0.03;
  EXPECT_TRUE(LoadWith(Verification()).ok());
}

TEST_F(VerifiedSceneTest, VerificationInNarrowerJointRangesIsNone) {
  storage::v1::ModelVerification verification = Verification();
  storage::v1::VerifiedRange& lift = *verification.mutable_ranges(1);
  lift.set_upper(lift.upper() - 0.1);
  const auto loaded = LoadWith(verification);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_THAT((*loaded)->unverified(), HasSubstr("its joint 'lift' moves from"));
}

TEST_F(VerifiedSceneTest, VerificationOfAnotherRobotIsNone) {
  storage::v1::ModelVerification verification = Verification();
  ASSERT_FALSE((*LoadWith(verification))->unverified_model());
  calibration.cameras[1] = calibration.cameras[1].ScaledTo(128, 128);
  EXPECT_FALSE((*Load({.calibration = calibration, .drawn = cell}))->unverified_model())
      << "of images of another size, the same masks";
  std::swap(calibration.cameras[1], calibration.cameras[2]);
  const auto swapped = Load({.calibration = calibration, .drawn = cell});
  ASSERT_TRUE(swapped.ok()) << swapped.status();
  EXPECT_TRUE((*swapped)->unverified_model());
  EXPECT_THAT((*swapped)->unverified(), HasSubstr("are others than when captured"));
  for (const RobotPart& part : (*swapped)->robot_images().drawn()->parts()) {
    // The tip slides with the fixed joint.
    EXPECT_DOUBLE_EQ(part.radius, part.link == 3 ? 0.01 : 0.005) << "nothing of it is used";
  }
  std::swap(calibration.cameras[1], calibration.cameras[2]);
  cell.parts.tolerance = 0.004;
  EXPECT_TRUE((*Load({.calibration = calibration, .drawn = cell}))->unverified_model());
  cell.parts.tolerance = 0.005;
  ASSERT_FALSE((*Load({.calibration = calibration, .drawn = cell}))->unverified_model());
  verification.mutable_link_growth(3)->set_link("tool");
  EXPECT_TRUE((*LoadWith(verification))->unverified_model());
  verification = Verification();
  verification.mutable_link_growth(3)->set_growth(-0.01);
  EXPECT_EQ(LoadWith(verification).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace silhouette
