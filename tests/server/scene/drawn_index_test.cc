// SPDX-License-Identifier: Apache-2.0
// Maps of a drawn robot that come from stored drawn images.
#include <gmock/gmock.h>

#include <bit>

#include "calib/robot/drawn_digest.h"
#include "capture/session/drawn_images.h"
#include "server/scene/checker.h"
#include "tests/random.h"
#include "tests/server/drawn_cell.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

const Moment kIndexNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

struct DrawnIndexTest : ::testing::Test {
  DrawnIndexTest() {
    cell.forbidden = JointRegions({{{.joint = 1, .lower = 1.5, .upper = 2}}});
    cell.forbidden_text = "lift 1.5 2; \n";
  }

  static storage::v1::CellDescription Description() {
    storage::v1::CellDescription description = DrawnCellDescription();
    description.mutable_grid_joints(0)->set_steps(70);
    description.mutable_grid_joints(1)->set_steps(90);
    return description;
  }

  DrawnRobot Robot(const DrawnCell& drawn) const {
    return DrawnRobotOf(drawn, std::vector<std::string>{"turn", "lift"},
                        std::vector<FixedJoint>{{"reach", 0.1}}, calibration,
                        std::vector<MaskSize>(4, kDrawnSize), /*margin=*/0)
        .value();
  }

  // Draws `drawn` into the database `name`, with its index; nothing: an empty database.
  void Make(const std::string& name, const std::optional<DrawnCell>& drawn) const {
    const auto database = Database::Create((folder / name).string(), Description());
    ASSERT_TRUE(database.ok()) << database.status();
    if (!drawn) return;
    const auto robot = std::make_shared<const DrawnRobot>(Robot(*drawn));
    storage::v1::DrawnImages images;
    images.set_digest(DigestOf(*robot));
    images.set_forbidden(drawn->forbidden_text);
    images.set_tolerance(drawn->parts.tolerance);
    const auto report =
        DrawInto(**database, images, WholeRobot(robot, drawn->forbidden), {.program = "test"});
    ASSERT_TRUE(report.ok()) << report.status();
    ASSERT_TRUE(BuildCollisionIndex(**database).ok());
  }

  absl::StatusOr<std::shared_ptr<const ServedDatabase>> Load(
      const std::string& name, const std::optional<DrawnCell>& drawn) const {
    const auto database = Database::Open((folder / name).string(), Database::Access::kRead);
    EXPECT_TRUE(database.ok()) << database.status();
    return ServedDatabase::Load(**database, {.margin = 0}, {}, sound,
                                {.calibration = calibration, .drawn = drawn});
  }

  Served ServedScene(const std::shared_ptr<const ServedDatabase>& database,
                     const SceneInput& input) const {
    absl::StatusOr<Scene> scene = MakeScene(*database, input, settings, {}, kIndexNow);
    EXPECT_TRUE(scene.ok()) << scene.status();
    scene->id = 1;
    return {database, std::make_shared<const Scene>(*std::move(scene)), Reason::kNone};
  }

  Random random;
  std::filesystem::path folder = FreshFolder();
  std::shared_ptr<const RobotModel> model = std::make_shared<const RobotModel>(DrawnModel());
  Calibration calibration = DrawnCalibration();
  DrawnCell cell{.robot = model, .parts = {}};
  std::optional<SoundCell> sound;
  SceneSettings settings;
};

TEST_F(DrawnIndexTest, MapByTheIndexIsTheMapThatIsDrawn) {
  sound = SoundCell{.settings = {.least_obstacle = 0.15,
                                 .voxel_edge = {},
                                 .model_tolerance = 0.005,
                                 .whole_model = true},
                    .workspace = Eigen::AlignedBox3d(Eigen::Vector3d(-1.1, -1.1, 0),
                                                     Eigen::Vector3d(1.1, 1.1, 1.8)),
                    .payload_radius = 0,
                    .robot = model};
  // The robot leaves it where it stretches upwards.
  sound->workspace.max().z() = 1.2;
  sound->robot_may_leave = true;
  Make("stored", cell);
  Make("empty", std::nullopt);
  const auto stored = Load("stored", cell);
  const auto drawn = Load("empty", cell);
  ASSERT_TRUE(stored.ok()) << stored.status();
  ASSERT_TRUE(drawn.ok()) << drawn.status();
  ASSERT_NE((*stored)->index(), nullptr) << (*stored)->index_unused();
  ASSERT_EQ((*drawn)->index(), nullptr);
  EXPECT_EQ((*drawn)->index_unused(), "");
  const DrawnRobot truth = Robot({.robot = model, .parts = {.tolerance = 0}});
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  uint64_t free = 0;
  uint64_t occupied = 0;
  for (int scene = 0; scene < SampleCount(4); ++scene) {
    const std::vector<DrawnCellBall> balls = {
        {{between(-0.8, 0.8), between(-0.8, 0.8), between(0.2, 1.4)}, between(0.05, 0.2)}};
    const SceneInput input = DrawnSceneInput(truth, {between(-3, 3), between(-1.9, 1.4)}, balls);
    const Served by_index = ServedScene(*stored, input);
    const Served by_drawing = ServedScene(*drawn, input);
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kSoundPlanes}) {
      const std::vector<TileVerdicts> a = CheckAllTiles(by_index, {.preset = preset});
      const std::vector<TileVerdicts> b = CheckAllTiles(by_drawing, {.preset = preset});
      ASSERT_EQ(a.size(), b.size());
      for (size_t tile = 0; tile < a.size(); ++tile) {
        ASSERT_EQ(a[tile].free, b[tile].free) << NameOf(preset) << ", tile " << tile;
        ASSERT_EQ(a[tile].occupied, b[tile].occupied) << NameOf(preset) << ", tile " << tile;
        for (const uint64_t word : a[tile].free) free += std::popcount(word);
        for (const uint64_t word : a[tile].occupied) occupied += std::popcount(word);
      }
    }
  }
  EXPECT_GT(free, static_cast<uint64_t>(SampleCount(1000)));
  EXPECT_GT(occupied, static_cast<uint64_t>(SampleCount(1000)));
}

TEST_F(DrawnIndexTest, ImagesOfAnotherRobotCalibrationOrRegionAreNotUsedAndTheServerSaysWhy) {
  Make("stored", cell);
  DrawnCell other = cell;
  other.parts.tolerance = 0.02;
  auto loaded = Load("stored", other);
  ASSERT_TRUE(loaded.ok()) << loaded.status();
  EXPECT_EQ((*loaded)->index(), nullptr);
  EXPECT_THAT((*loaded)->index_unused(), HasSubstr("drawn from another tolerance"));
  other = cell;
  other.payload_radius = 0.1;
  loaded = Load("stored", other);
  EXPECT_EQ((*loaded)->index(), nullptr);
  EXPECT_THAT((*loaded)->index_unused(),
              HasSubstr("another model, calibration, margin or link growth"));
  other = cell;
  other.forbidden_text = "";
  loaded = Load("stored", other);
  EXPECT_EQ((*loaded)->index(), nullptr);
  EXPECT_THAT((*loaded)->index_unused(), HasSubstr("other forbidden regions"));
  calibration.cameras[0] =
      CameraModel({.width = 64, .height = 64, .fx = 71, .fy = 70, .cx = 31.5, .cy = 31.5},
                  calibration.cameras[0].camera_from_world());
  loaded = Load("stored", cell);
  EXPECT_EQ((*loaded)->index(), nullptr);
  EXPECT_THAT((*loaded)->index_unused(),
              HasSubstr("another model, calibration, margin or link growth"));
}

TEST_F(DrawnIndexTest, DrawnImagesAreNeverServedAsCapturedOnes) {
  Make("stored", cell);
  const auto loaded = Load("stored", std::nullopt);
  EXPECT_TRUE(absl::IsFailedPrecondition(loaded.status())) << loaded.status();
  EXPECT_THAT(std::string(loaded.status().message()), HasSubstr("its robot images were drawn"));
}

}  // namespace
}  // namespace silhouette
