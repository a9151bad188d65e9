// SPDX-License-Identifier: Apache-2.0
// Verdicts on the nodes of an arm, against verdicts at joint values of their cells.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "server/collision/collision_checker.h"
#include "tests/random.h"
#include "tests/server/collision/drawn_arm.h"

namespace silhouette {
namespace {

// The slide at the tip is the wrist.
class ArmNodesTest : public ::testing::Test {
 protected:
  static ConfigurationGrid Grid() {
    return ConfigurationGrid({{.name = "turn",
                               .lower = -std::numbers::pi,
                               .upper = std::numbers::pi,
                               .steps = 30,
                               .continuous = true},
                              {.name = "lift", .lower = -2, .upper = 2, .steps = 20},
                              {.name = "reach", .lower = 0, .upper = 0.2, .steps = 1}});
  }

  double Between(double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random_);
  }

  // Joint values whose nearest node it is.
  Configuration InCell(ConfigurationNumber node) {
    while (true) {
      Configuration q = table_.grid().At(node);
      for (size_t j = 0; j < 2; ++j) q[j] += Between(-0.5, 0.5) * table_.grid().joints()[j].step();
      q[2] = Between(0, 0.2);
      if (table_.grid().Nearest(q) == node) return q;
    }
  }

  Random random_;
  const DrawnArm arm_;
  const RobotImageTable table_ = RobotImageTable::Drawn(Grid(), arm_.robot());
  const EpipolarBands bands_{Calibration{.cameras = arm_.cameras(), .fundamental_matrices = {}},
                             arm_.sizes()};
};

TEST_F(ArmNodesTest, FreeHoldsInAllOfTheCellAndOccupiedWhateverTheWristDoes) {
  size_t counts[3] = {};
  for (int scene = 0; scene < 8; ++scene) {
    const auto [balls, images] = arm_.SomeScene(random_, 1 + scene % 3);
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated}) {
      const CollisionChecker test(table_, images, {.preset = preset}, {.bands = &bands_});
      for (int i = 0; i < SampleCount(100); ++i) {
        const ConfigurationNumber node = table_.grid().NumberOf(
            {static_cast<int>(random_() % 30), static_cast<int>(random_() % 20), 0});
        const Verdict verdict = test.Check(node);
        ++counts[static_cast<size_t>(verdict.state())];
        for (int k = 0; k < 6; ++k) {
          if (verdict.free()) {
            ASSERT_TRUE(test.Check(InCell(node)).free()) << NameOf(preset);
          }
          Configuration at = table_.grid().At(node);
          at[2] = Between(0, 0.2);
          if (verdict.state() == State::kOccupied) {
            ASSERT_EQ(test.Check(at).state(), State::kOccupied) << NameOf(preset);
          }
        }
        if (verdict.state() == State::kUnknown) {
          ASSERT_EQ(verdict.reason(), Reason::kDependsOnWrist);
        }
      }
    }
  }
  for (const size_t count : counts) EXPECT_GT(count, static_cast<size_t>(SampleCount(100)));
}

TEST_F(ArmNodesTest, TilesAreTheirNodes) {
  const auto [balls, images] = arm_.SomeScene(random_, 2);
  const CollisionChecker test(table_, images, {});
  for (uint64_t tile = 0; tile < table_.grid().tiles(); ++tile) {
    const TileVerdicts verdicts = test.CheckTile(tile);
    for (uint64_t place = 0; place < kTileSize; ++place) {
      const State state = test.Check(tile * kTileSize + place).state();
      ASSERT_EQ((verdicts.free[place / 64] >> (place % 64) & 1) != 0, state == State::kFree);
      ASSERT_EQ((verdicts.occupied[place / 64] >> (place % 64) & 1) != 0,
                state == State::kOccupied);
    }
  }
}

TEST_F(ArmNodesTest, MissingViewIsNeverFree) {
  auto [balls, images] = arm_.SomeScene(random_, 1);
  images[2].reset();
  const CollisionChecker test(table_, images, {});
  for (int turn = 0; turn < 30; ++turn) {
    for (int lift = 0; lift < 20; ++lift) {
      EXPECT_FALSE(test.Check(table_.grid().NumberOf({turn, lift, 0})).free());
    }
  }
}

TEST_F(ArmNodesTest, NodeIsExcludedIfAnyOfItsCellIsForbidden) {
  const auto [balls, images] = arm_.SomeScene(random_, 1);
  const RobotImageTable table = RobotImageTable::Drawn(
      Grid(), arm_.robot(), JointRegions({{{.joint = 2, .lower = 0.19, .upper = 1}}}));
  const CollisionChecker test(table, images, {});
  EXPECT_EQ(test.Check(ConfigurationNumber{0}).reason(), Reason::kExcluded);
  EXPECT_NE(test.Check(table.grid().At(0)).reason(), Reason::kExcluded);
}

// What is drawn of a node is not what is drawn at the middle of the wrist's range.
TEST_F(ArmNodesTest, HaveNoImageOfTheWholeRobot) {
  std::vector<uint64_t> words(table_.words());
  EXPECT_TRUE(table_.has_nodes());
  EXPECT_FALSE(table_.Read(0, words));
  EXPECT_FALSE(arm_.Table().has_nodes());
  EXPECT_THROW(arm_.Table().DrawNode(DrawnKind::kReach, 0, words), std::invalid_argument);
  EXPECT_THROW(RobotImageTable::Builder(Grid(), arm_.sizes()), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
