// SPDX-License-Identifier: Apache-2.0
// Maps of nodes of an arm that come from stored own and reach images.
#include <gmock/gmock.h>

#include <bit>

#include "calib/robot/drawn_digest.h"
#include "capture/session/drawn_images.h"
#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/random.h"
#include "tests/server/drawn_cell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

const Moment kArmNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

// The joint "turn" is the arm, "lift" the wrist.
struct ArmIndexTest : ::testing::Test {
  static storage::v1::CellDescription Description() {
    storage::v1::CellDescription description = DrawnCellDescription();
    description.mutable_grid_joints(0)->set_steps(360);
    description.mutable_grid_joints(1)->set_steps(1);
    return description;
  }

  DrawnRobot Robot(const DrawnCell& drawn) const {
    return DrawnRobotOf(drawn, std::vector<std::string>{"turn", "lift"},
                        std::vector<FixedJoint>{{"reach", 0.1}}, calibration,
                        std::vector<MaskSize>(4, kDrawnSize), /*margin=*/0)
        .value();
  }

  // Draws the kinds into the database `name`, with their indices.
  void Make(const std::string& name, const std::vector<DrawnKind>& kinds) const {
    const auto database = Database::Create((folder / name).string(), Description());
    ASSERT_TRUE(database.ok()) << database.status();
    const ConfigurationGrid& grid = (*database)->grid();
    for (const DrawnKind kind : kinds) {
      const auto robot = std::make_shared<const DrawnRobot>(AsKind(Robot(cell), grid, kind));
      storage::v1::DrawnImages images;
      images.set_digest(DigestOf(*robot));
      images.set_forbidden(cell.forbidden_text);
      images.set_tolerance(cell.parts.tolerance);
      const auto variant = (*database)->CreateVariant(NameOf(kind), "test");
      ASSERT_TRUE(variant.ok()) << variant.status();
      const auto report =
          DrawInto(**variant, images, ArmNodes(robot, grid, cell.forbidden), {.program = "test"});
      ASSERT_TRUE(report.ok()) << report.status();
    }
    ASSERT_TRUE(BuildCollisionIndex(**database).ok());
  }

  absl::StatusOr<std::shared_ptr<const ServedDatabase>> Load(
      const std::string& name, const std::optional<DrawnCell>& drawn) const {
    const auto database = Database::Open((folder / name).string(), Database::Access::kRead);
    EXPECT_TRUE(database.ok()) << database.status();
    return ServedDatabase::Load(**database, {.margin = 0}, {}, std::nullopt,
                                {.calibration = calibration, .drawn = drawn});
  }

  std::shared_ptr<const ServedDatabase> Loaded(const std::string& name) const {
    auto loaded = Load(name, cell);
    EXPECT_TRUE(loaded.ok()) << loaded.status();
    return *loaded;
  }

  // With a ball that the robot does not hide.
  Served ServedScene(const std::shared_ptr<const ServedDatabase>& database,
                     const SceneInput& input) const {
    absl::StatusOr<Scene> scene = MakeScene(*database, input, settings, {}, kArmNow);
    EXPECT_TRUE(scene.ok()) << scene.status();
    scene->id = 1;
    return {database, std::make_shared<const Scene>(*std::move(scene)), Reason::kNone};
  }

  SceneInput SomeInput() {
    const DrawnRobot truth = Robot({.robot = model, .parts = {.tolerance = 0}});
    const std::vector<DrawnCellBall> balls = {
        {{Between(-0.8, 0.8), Between(-0.8, 0.8), Between(0.2, 1.4)}, Between(0.05, 0.2)}};
    return DrawnSceneInput(truth, {Between(-3, 3), Between(-1.9, 1.4)}, balls);
  }

  double Between(double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  }

  Random random;
  std::filesystem::path folder = FreshFolder();
  std::shared_ptr<const RobotModel> model = std::make_shared<const RobotModel>(DrawnModel());
  Calibration calibration = DrawnCalibration();
  DrawnCell cell{.robot = model, .parts = {}};
  SceneSettings settings;
};

TEST_F(ArmIndexTest, MapByTheIndexIsTheMapThatIsDrawnAndHoldsAtAllJointValues) {
  cell.forbidden = JointRegions({{{.joint = 0, .lower = 3, .upper = 4}}});
  cell.forbidden_text = "turn 3 4; \n";
  Make("stored", {DrawnKind::kOwn, DrawnKind::kReach});
  Make("empty", {});
  const auto stored = Loaded("stored");
  const auto drawn = Loaded("empty");
  ASSERT_NE(stored->node_index(DrawnKind::kOwn), nullptr) << stored->index_unused();
  EXPECT_EQ(drawn->node_index(DrawnKind::kOwn), nullptr);
  EXPECT_THAT(stored->variants(), testing::ElementsAre("default"));
  size_t counts[3] = {};
  for (int scene = 0; scene < SampleCount(6); ++scene) {
    const SceneInput input = SomeInput();
    const Served by_index = ServedScene(stored, input);
    const Served by_drawing = ServedScene(drawn, input);
    for (int min_views = 2; min_views <= 4; ++min_views) {
      const Policy policy{.min_views = min_views};
      const ConfigurationSpace a(by_index, policy);
      const ConfigurationSpace b(by_drawing, policy);
      EXPECT_TRUE(a.looked_up(0));
      EXPECT_FALSE(b.looked_up(0));
      const Checker checker(by_index, policy, settings, kArmNow);
      for (ConfigurationNumber number = 0; number < stored->grid().number_limit(); ++number) {
        ASSERT_EQ(a.state(number), b.state(number)) << number;
        if (!stored->grid().Contains(number)) continue;
        ++counts[static_cast<size_t>(a.state(number))];
        Configuration q = stored->grid().At(number);
        q[1] = Between(-2, 2);
        if (a.state(number) == State::kOccupied) {
          ASSERT_EQ(checker.Check(q).state(), State::kOccupied);
        }
        q[0] += Between(-0.49, 0.49) * stored->grid().joints()[0].step();
        if (a.state(number) == State::kFree) {
          ASSERT_TRUE(checker.Check(q).free());
        }
      }
    }
  }
  EXPECT_GT(counts[static_cast<size_t>(State::kFree)], 30u);
  EXPECT_GT(counts[static_cast<size_t>(State::kUnknown)], 30u);
}

TEST_F(ArmIndexTest, ChecksBehindTheMapAreThoseThatAreDrawn) {
  Make("stored", {DrawnKind::kOwn, DrawnKind::kReach});
  const auto stored = Loaded("stored");
  size_t behind = 0;
  for (int scene = 0; scene < 10; ++scene) {
    const Served served = ServedScene(stored, SomeInput());
    for (int min_views = 1; min_views <= 4; ++min_views) {
      const Policy policy{.min_views = min_views};
      const auto map = std::make_shared<const ConfigurationSpace>(served, policy);
      const Checker drawn(served, policy, settings, kArmNow);
      const Checker by_map(served, policy, settings, kArmNow, map);
      const ConfigurationNumber any = *stored->grid().Nearest(Configuration{0, 0});
      by_map.Check(Configuration{0, 0});
      EXPECT_FALSE(map->ready(any / kTileSize)) << "nothing is worked out for checks";
      for (uint64_t tile = 0; tile < map->tiles(); ++tile) map->tile(tile);
      for (int i = 0; i < SampleCount(2500); ++i) {
        const Configuration q = {Between(-4, 4), Between(-2.01, 2.01)};
        const Verdict one = by_map.Check(q);
        const Verdict other = drawn.Check(q);
        ASSERT_EQ(one.state(), other.state());
        ASSERT_EQ(one.reason(), other.reason());
        ASSERT_GE(one.hidden_possible(), other.hidden_possible());
        std::vector<ViewEvidence> evidence(4);
        std::vector<ViewEvidence> other_evidence(4);
        ASSERT_EQ(by_map.Check(q, evidence), drawn.Check(q, other_evidence));
        ASSERT_EQ(evidence, other_evidence);
        const auto node = stored->grid().Nearest(q);
        if (node && map->KnownFree(*node)) ++behind;
      }
    }
  }
  EXPECT_GT(behind, static_cast<size_t>(SampleCount(10'000)));
}

TEST_F(ArmIndexTest, MissingViewFreesNoNode) {
  Make("stored", {DrawnKind::kOwn, DrawnKind::kReach});
  const auto stored = Loaded("stored");
  SceneInput input = SomeInput();
  input.views.pop_back();
  const ConfigurationSpace space(ServedScene(stored, input), {});
  for (ConfigurationNumber number = 0; number < 360; ++number) {
    EXPECT_NE(space.state(number), State::kFree);
  }
}

TEST_F(ArmIndexTest, ImagesOfAnotherRobotAreNotUsedAndTheServerSaysWhy) {
  Make("stored", {DrawnKind::kOwn, DrawnKind::kReach});
  cell.payload_radius = 0.1;
  const auto loaded = Loaded("stored");
  EXPECT_EQ(loaded->node_index(DrawnKind::kReach), nullptr);
  EXPECT_EQ(loaded->index(), nullptr);
  EXPECT_THAT(loaded->index_unused(), HasSubstr("draw the images again"));
}

TEST_F(ArmIndexTest, OneKindAloneDecidesNothing) {
  Make("stored", {DrawnKind::kReach});
  const auto loaded = Loaded("stored");
  EXPECT_EQ(loaded->node_index(DrawnKind::kReach), nullptr);
  EXPECT_EQ(loaded->node_index(DrawnKind::kOwn), nullptr);
}

// The robot at one value of the wrist is no node.
TEST_F(ArmIndexTest, ImagesOfWholeRobotsDecideNothing) {
  const auto database = Database::Create((folder / "whole").string(), Description());
  ASSERT_TRUE(database.ok()) << database.status();
  const auto robot = std::make_shared<const DrawnRobot>(Robot(cell));
  storage::v1::DrawnImages images;
  images.set_digest(DigestOf(*robot));
  images.set_tolerance(cell.parts.tolerance);
  ASSERT_TRUE(DrawInto(**database, images, WholeRobot(robot, {}), {.program = "test"}).ok());
  ASSERT_TRUE(BuildCollisionIndex(**database).ok());
  const auto loaded = Loaded("whole");
  EXPECT_EQ(loaded->index(), nullptr);
  const ConfigurationSpace space(ServedScene(loaded, SomeInput()), {});
  EXPECT_FALSE(space.looked_up(0));
}

TEST_F(ArmIndexTest, CapturedImagesAreNotServedOnNodes) {
  Make("stored", {});
  const auto loaded = Load("stored", std::nullopt);
  ASSERT_FALSE(loaded.ok());
  EXPECT_THAT(std::string(loaded.status().message()), HasSubstr("stands for any"));
}

}  // namespace
}  // namespace silhouette
