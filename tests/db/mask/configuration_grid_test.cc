// SPDX-License-Identifier: Apache-2.0
#include "db/mask/configuration_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <set>
#include <stdexcept>

#include "tests/random.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAreArray;

constexpr double kTurn = 2 * std::numbers::pi;

// A grid of `joints` joints with a few thousand configurations; some joints are continuous, some
// stand still.
ConfigurationGrid RandomGrid(int joints, std::mt19937_64& random) {
  const int most = joints <= 2 ? 60 : joints == 3 ? 14 : joints <= 5 ? 6 : 4;
  std::vector<GridJoint> list;
  for (int j = 0; j < joints; ++j) {
    GridJoint joint;
    joint.name = "joint " + std::to_string(j);
    joint.lower = -3 + static_cast<double>(random() % 1000) / 400;
    joint.continuous = random() % 3 == 0;
    joint.steps = 1 + static_cast<int>(random() % static_cast<uint64_t>(most));
    if (joint.continuous) joint.steps = std::max(joint.steps, 3);
    joint.upper =
        joint.lower + (joint.continuous   ? kTurn
                       : joint.steps == 1 ? 0
                                          : 0.3 + static_cast<double>(random() % 100) / 30);
    list.push_back(joint);
  }
  return ConfigurationGrid(list);
}

class RandomGrids : public testing::TestWithParam<int> {
 protected:
  ConfigurationGrid Next() { return RandomGrid(GetParam(), random_); }

  // A configuration within the grid's ranges.
  Configuration RandomConfiguration(const ConfigurationGrid& grid) {
    Configuration q;
    for (const GridJoint& joint : grid.joints()) {
      q.push_back(
          std::uniform_real_distribution(joint.lower, std::nextafter(joint.upper, 9))(random_));
    }
    return q;
  }

  Random random_;
};

INSTANTIATE_TEST_SUITE_P(Joints, RandomGrids, testing::Range(1, 8));

TEST_P(RandomGrids, NumberEveryConfigurationOnce) {
  for (int round = 0; round < 5; ++round) {
    const ConfigurationGrid grid = Next();
    uint64_t size = 1;
    for (const GridJoint& joint : grid.joints()) size *= static_cast<uint64_t>(joint.steps);
    ASSERT_EQ(grid.size(), size);
    std::set<GridIndex> seen;
    for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
      const std::optional<GridIndex> index = grid.IndexOf(number);
      ASSERT_EQ(grid.Contains(number), index.has_value());
      if (!index) continue;
      for (int j = 0; j < kMaxJoints; ++j) {
        const int steps = j < grid.dimensions() ? grid.joints()[static_cast<size_t>(j)].steps : 1;
        ASSERT_GE((*index)[static_cast<size_t>(j)], 0);
        ASSERT_LT((*index)[static_cast<size_t>(j)], steps);
      }
      ASSERT_TRUE(seen.insert(*index).second);
      ASSERT_EQ(grid.NumberOf(*index), number);
    }
    EXPECT_EQ(seen.size(), size);
    EXPECT_FALSE(grid.Contains(grid.number_limit()));
    EXPECT_FALSE(grid.Contains(~uint64_t{0}));
  }
}

TEST_P(RandomGrids, KeepTilesTogether) {
  const ConfigurationGrid grid = Next();
  const int product =
      std::accumulate(grid.tile_edges().begin(), grid.tile_edges().end(), 1, std::multiplies<>());
  EXPECT_EQ(product, 4096);
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    const std::optional<GridIndex> index = grid.IndexOf(number);
    const std::optional<GridIndex> first = grid.IndexOf(number / kTileSize * kTileSize);
    ASSERT_TRUE(first.has_value());  // no tile is wholly absent
    if (!index) continue;
    for (size_t j = 0; j < grid.tile_edges().size(); ++j) {
      const int edge = grid.tile_edges()[j];
      ASSERT_EQ((*index)[j] / edge, (*first)[j] / edge);
    }
  }
}

TEST_P(RandomGrids, FindGridPointsThatTheyGiveOut) {
  const ConfigurationGrid grid = Next();
  for (int i = 0; i < 200; ++i) {
    const ConfigurationNumber number = random_() % grid.number_limit();
    if (!grid.Contains(number)) continue;
    const Configuration q = grid.At(number);
    EXPECT_EQ(grid.Nearest(q), number);
    const CellCorners corners = grid.CornersAround(q);
    ASSERT_EQ(corners.count(), 1);
    EXPECT_EQ(corners.numbers()[0], number);
  }
}

TEST_P(RandomGrids, HaveNeighboursOneStepAwayThatWrapOnlyWhereContinuous) {
  const ConfigurationGrid grid = Next();
  for (int i = 0; i < 300; ++i) {
    const std::optional<GridIndex> index = grid.IndexOf(random_() % grid.number_limit());
    if (!index) continue;
    for (int j = 0; j < grid.dimensions(); ++j) {
      const GridJoint& joint = grid.joints()[static_cast<size_t>(j)];
      for (int delta = -joint.steps - 1; delta <= joint.steps + 1; ++delta) {
        const std::optional<GridIndex> neighbour = grid.Neighbour(*index, j, delta);
        GridIndex expected = *index;
        int& step = expected[static_cast<size_t>(j)];
        step += delta;
        const bool inside = step >= 0 && step < joint.steps;
        if (!inside && !joint.continuous) {
          EXPECT_EQ(neighbour, std::nullopt);
          continue;
        }
        while (step < 0) step += joint.steps;
        while (step >= joint.steps) step -= joint.steps;
        EXPECT_EQ(neighbour, expected);
      }
    }
  }
}

// The corners by definition: along each joint the values next to q on both sides.
std::vector<ConfigurationNumber> CornersByDefinition(const ConfigurationGrid& grid,
                                                     const Configuration& q) {
  std::vector<GridIndex> corners = {GridIndex{}};
  for (size_t j = 0; j < q.size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    std::set<int> steps;
    const double place = joint.steps == 1 ? 0 : (q[j] - joint.lower) / joint.step();
    for (double neighbour : {std::floor(place), std::ceil(place)}) {
      steps.insert(static_cast<int>(neighbour) % joint.steps);
    }
    std::vector<GridIndex> next;
    for (GridIndex corner : corners) {
      for (int step : steps) {
        corner[j] = step;
        next.push_back(corner);
      }
    }
    corners = next;
  }
  std::vector<ConfigurationNumber> numbers;
  for (const GridIndex& corner : corners) numbers.push_back(grid.NumberOf(corner));
  return numbers;
}

TEST_P(RandomGrids, FindTheCornersAroundAndTheNearestOfThem) {
  for (int round = 0; round < 50; ++round) {
    const ConfigurationGrid grid = Next();
    const Configuration q = RandomConfiguration(grid);
    const CellCorners corners = grid.CornersAround(q);
    ASSERT_THAT(corners.numbers(), UnorderedElementsAreArray(CornersByDefinition(grid, q)));
    const std::optional<ConfigurationNumber> nearest = grid.Nearest(q);
    ASSERT_TRUE(nearest.has_value());
    const Configuration p = grid.At(*nearest);
    for (size_t j = 0; j < q.size(); ++j) {
      const GridJoint& joint = grid.joints()[j];
      double distance = std::abs(q[j] - p[j]);
      if (joint.continuous) distance = std::min(distance, std::abs(kTurn - distance));
      EXPECT_LE(distance, joint.step() / 2 * (1 + 1e-6) + 1e-12);
    }
  }
}

TEST_P(RandomGrids, KnowNothingOutside) {
  for (int round = 0; round < 20; ++round) {
    const ConfigurationGrid grid = Next();
    const Configuration inside = RandomConfiguration(grid);
    ASSERT_TRUE(grid.Nearest(inside).has_value());
    std::vector<Configuration> outside;
    for (size_t j = 0; j < inside.size(); ++j) {
      const GridJoint& joint = grid.joints()[j];
      for (double value : {joint.lower - 0.1, joint.upper + 0.1}) {
        if (joint.continuous) continue;
        outside.push_back(inside);
        outside.back()[j] = value;
      }
      for (double value : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
        outside.push_back(inside);
        outside.back()[j] = value;
      }
    }
    outside.push_back(inside);
    outside.back().push_back(0);
    outside.push_back(inside);
    outside.back().pop_back();
    for (const Configuration& q : outside) {
      EXPECT_EQ(grid.Nearest(q), std::nullopt);
      EXPECT_EQ(grid.CornersAround(q).count(), 0);
    }
  }
}

TEST(ConfigurationGrid, WrapsAContinuousJointByWholeTurns) {
  const ConfigurationGrid grid({{"turn", -std::numbers::pi, std::numbers::pi, 8, true}});
  EXPECT_NEAR(grid.joints()[0].step(), kTurn / 8, 1e-12);
  for (int turns : {-2, 0, 3}) {
    const std::vector<double> q = {-std::numbers::pi + 7.5 * kTurn / 8 + turns * kTurn};
    const CellCorners corners = grid.CornersAround(q);
    EXPECT_THAT(std::vector(corners.numbers().begin(), corners.numbers().end()), ElementsAre(7, 0));
  }
  EXPECT_EQ(grid.Nearest(std::vector{std::numbers::pi}), 0);
  EXPECT_NEAR(grid.At(GridIndex{7})[0], std::numbers::pi - kTurn / 8, 1e-12);
}

TEST(ConfigurationGrid, HasAPlaceForEveryValueNextToTheEndOfATurn) {
  for (int steps = 3; steps < 60; ++steps) {
    const ConfigurationGrid grid({{"turn", -std::numbers::pi, std::numbers::pi, steps, true}});
    for (int turn = -1; turn < 2; ++turn) {
      double value = -std::numbers::pi + (steps * (turn + 1) - 1e-6) * grid.joints()[0].step();
      for (int i = 0; i < 100; ++i) value = std::nextafter(value, -99);
      for (int i = 0; i < 200; ++i, value = std::nextafter(value, 99)) {
        ASSERT_LT(grid.Place(0, value), steps) << value;
        ASSERT_GT(grid.CornersAround(std::vector{value}).count(), 0) << value;
      }
    }
  }
}

// A double of that size does not say where in its turn the joint is.
TEST(ConfigurationGrid, HasNoPlaceForAContinuousJointABillionStepsAway) {
  const ConfigurationGrid grid({{"turn", -std::numbers::pi, std::numbers::pi, 8, true}});
  EXPECT_TRUE(grid.Place(0, 7e8));
  for (const double value : {8e8, -8e8, 1e16, 1e308}) {
    EXPECT_FALSE(grid.Place(0, value)) << value;
    EXPECT_FALSE(grid.Nearest(std::vector{value})) << value;
    EXPECT_EQ(grid.CornersAround(std::vector{value}).count(), 0) << value;
  }
}

TEST(ConfigurationGrid, HasItsLimitsAmongItsValues) {
  const ConfigurationGrid grid({{"slide", 0.1, 0.7, 7, false}, {"fixed", 0.3, 0.3, 1, false}});
  EXPECT_THAT(grid.At(GridIndex{0, 0}), ElementsAre(0.1, 0.3));
  EXPECT_THAT(grid.At(GridIndex{6, 0}), ElementsAre(0.7, 0.3));
  EXPECT_EQ(grid.Nearest(std::vector{0.7, 0.3}), grid.NumberOf({6, 0}));
  EXPECT_EQ(grid.Nearest(std::vector{0.7, 0.31}), std::nullopt);
}

std::string Refusal(const std::vector<GridJoint>& joints, const std::vector<int>& edges = {}) {
  try {
    ConfigurationGrid grid(joints, edges);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "none";
}

TEST(ConfigurationGrid, HasJointsWhoseOneValueStandsForAny) {
  const ConfigurationGrid grid(
      {{.name = "arm", .lower = 0, .upper = 1, .steps = 3},
       {.name = "bend", .lower = -2, .upper = 1, .steps = 1},
       {.name = "roll", .lower = 0, .upper = kTurn, .steps = 1, .continuous = true}});
  EXPECT_TRUE(grid.has_any());
  EXPECT_FALSE(grid.joints()[0].any());
  EXPECT_TRUE(grid.joints()[1].any());
  EXPECT_EQ(grid.size(), 3U);
  const ConfigurationNumber node = grid.NumberOf({1, 0, 0});
  EXPECT_THAT(grid.At(node), ElementsAre(0.5, -0.5, kTurn / 2));
  for (const Configuration& q : {Configuration{0.6, -2, 9}, {0.4, 1, -40}, grid.At(node)}) {
    EXPECT_EQ(grid.Nearest(q), node);
  }
  EXPECT_EQ(grid.CornersAround(Configuration{0.6, 0.3, 1}).count(), 2);
  EXPECT_EQ(grid.CornersAround(Configuration{0.5, 0.3, 1}).count(), 1);
  EXPECT_FALSE(grid.Nearest(Configuration{0.5, 1.1, 0}));
  EXPECT_FALSE(grid.Nearest(Configuration{0.5, -2.1, 0}));
  EXPECT_FALSE(grid.Nearest(Configuration{0.5, 0, std::nan("")}));
  EXPECT_FALSE(grid.Neighbour({1, 0, 0}, 1, 1));
  EXPECT_FALSE(ConfigurationGrid({{.name = "still", .lower = 1, .upper = 1}}).has_any());
}

TEST(ConfigurationGrid, TellsWhatIsWrongWithItsJoints) {
  const GridJoint good{"a", 0, 1, 5, false};
  const auto with = [&](const std::function<void(GridJoint&)>& spoil) {
    GridJoint joint = good;
    spoil(joint);
    return Refusal({joint});
  };
  EXPECT_EQ(Refusal({}), "a grid has 1 to 7 joints, not 0");
  EXPECT_EQ(Refusal(std::vector<GridJoint>(8, good)), "a grid has 1 to 7 joints, not 8");
  EXPECT_EQ(Refusal({good, good}), "joint 'a' is named twice");
  EXPECT_THAT(with([](GridJoint& j) { j.lower = 2; }), HasSubstr("joint 'a': lower and upper"));
  EXPECT_THAT(with([](GridJoint& j) { j.upper = HUGE_VAL; }), HasSubstr("must be finite"));
  EXPECT_THAT(with([](GridJoint& j) { j.steps = 0; }), HasSubstr("joint 'a': steps must be at"));
  EXPECT_THAT(with([](GridJoint& j) { j.upper = 0; }),
              HasSubstr("lower == upper goes with one step"));
  EXPECT_THAT(with([](GridJoint& j) { j.continuous = true; }), HasSubstr("spans one turn"));
  EXPECT_THAT(Refusal({{"c", 0, kTurn, 2, true}}), HasSubstr("needs at least 3 steps"));
  std::vector<GridJoint> many;
  for (const char* name : {"a", "b", "c", "d"}) many.push_back({name, 0, 1, 2000, false});
  EXPECT_THAT(Refusal(many), HasSubstr("more than 2^40 configurations"));
  // Products that are 0 modulo 2^64, and sums beyond an int.
  EXPECT_THAT(
      Refusal(
          {{"a", 0, 1, 1 << 20, false}, {"b", 0, 1, 1 << 20, false}, {"c", 0, 1, 1 << 24, false}}),
      HasSubstr("more than 2^40 configurations"));
  EXPECT_EQ(Refusal({{"a", 0, 1, std::numeric_limits<int>::max(), false}}), "none");
  EXPECT_THAT(Refusal({good}, {2048}), HasSubstr("with product 4096"));
  EXPECT_THAT(Refusal({good}, {64, 64}), HasSubstr("one tile edge per joint"));
  GridJoint other = good;
  other.name = "b";
  EXPECT_THAT(Refusal({good, other}, {3, 4096}), HasSubstr("powers of two"));
  EXPECT_EQ(Refusal({good, other}, {1, 4096}), "none");
}

TEST(ChooseTileEdges, AreLongWhereImagesChangeLittle) {
  std::vector<GridJoint> joints = {{"a", 0, 1, 1024, false}, {"b", 0, 1, 1024, false}};
  EXPECT_THAT(ChooseTileEdges(joints), ElementsAre(64, 64));
  EXPECT_THAT(ChooseTileEdges(joints, std::vector{1.0, 4.0}), ElementsAre(128, 32));
  // An arm and its wrist: a tile is all that the wrist does at one place of the arm.
  joints.clear();
  for (const int steps : {16, 16, 16, 16, 12, 13}) {
    joints.push_back({std::string(1, static_cast<char>('a' + joints.size())), 0, 1, steps, false});
  }
  EXPECT_THAT(ChooseTileEdges(joints, std::vector{0.25, 0.31, 0.13, 0.01, 0.012, 0.0}),
              ElementsAre(1, 1, 1, 16, 16, 16));
  // Few places are absent, however little they would change.
  EXPECT_THAT(
      ChooseTileEdges(std::vector<GridJoint>{{"a", 0, 1, 4000, false}, {"b", 0, 0, 1, false}}),
      ElementsAre(4096, 1));
  EXPECT_THROW(ChooseTileEdges(joints, std::vector(6, -1.0)), std::invalid_argument);
  EXPECT_THROW(ChooseTileEdges(joints, std::vector(5, 1.0)), std::invalid_argument);
}

TEST(ChooseTileEdges, WastesLittle) {
  std::mt19937_64 random(3);
  for (int joints = 1; joints <= 4; ++joints) {
    std::vector<GridJoint> list;
    for (int j = 0; j < joints; ++j) {
      list.push_back({std::to_string(j), 0, 1, 30 + static_cast<int>(random() % 70), false});
    }
    const ConfigurationGrid grid(list);
    if (grid.size() > 4 * kTileSize) {
      EXPECT_LT(grid.number_limit(), 3 * grid.size());
    }
  }
}

// Henrich, Wurll & Woern 1998: a chord of length delta at distance r spans 2 asin(delta / (2 r)).
TEST(MaxMove, StepsObeyTheChordAndNoneIsToSpare) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(0.1, 1.0);
  for (int i = 0; i < 200; ++i) {
    const double reach = 2 * uniform(random);
    const double delta = 0.3 * uniform(random);
    const GridJoint joint =
        MaxMoveJoint({"a", -uniform(random), 2 * uniform(random), 1, false}, reach, delta);
    EXPECT_LE(2 * reach * std::sin(joint.step() / 2), delta * (1 + 1e-9));
    const double coarser = (joint.upper - joint.lower) / std::max(1, joint.steps - 2);
    if (joint.steps > 2) {
      EXPECT_GT(2 * reach * std::sin(coarser / 2), delta * (1 - 1e-9));
    }
  }
}

TEST(MaxMove, HasTheValuesOfTheFormula) {
  // 2 asin(0.1 / 2) = 0.100042 rad: 62.8 steps in a turn.
  EXPECT_EQ(MaxMoveJoint({"a", 0, kTurn, 1, true}, 1.0, 0.1).steps, 63);
  // The same over a bounded turn has one value more than steps.
  EXPECT_EQ(MaxMoveJoint({"a", 0, kTurn, 1, false}, 1.0, 0.1).steps, 64);
  // 60 degrees subtend a chord as long as the radius.
  EXPECT_EQ(MaxMoveJoint({"a", 0, std::numbers::pi, 1, false}, 0.5, 0.5).steps, 4);
  // A prismatic joint steps by delta itself.
  EXPECT_EQ(MaxMoveJoint({"a", 0, 0.6, 1, false}, std::nullopt, 0.1).steps, 7);
  EXPECT_EQ(MaxMoveJoint({"a", 0, 0.61, 1, false}, std::nullopt, 0.1).steps, 8);
  // Wherever delta spans the whole circle, half a turn is one step.
  EXPECT_EQ(MaxMoveJoint({"a", 0, kTurn, 1, true}, 0.1, 5.0).steps, 3);
  // The hand's joints reach less far: their steps are larger.
  EXPECT_GT(MaxMoveJoint({"base", 0, 3, 1, false}, 1.25, 0.05).steps,
            MaxMoveJoint({"wrist", 0, 3, 1, false}, 0.2, 0.05).steps);
}

TEST(MaxMove, DividesDeltaForDiagonalMoves) {
  EXPECT_EQ(DeltaPerJoint(0.6, 3, MaxMoveRule::kEach), 0.6);
  EXPECT_DOUBLE_EQ(DeltaPerJoint(0.6, 3, MaxMoveRule::kSum), 0.2);
}

TEST(MaxMove, RefusesWhatHasNoMeaning) {
  const GridJoint range{"a", 0, 1, 1, false};
  EXPECT_THROW(MaxMoveJoint(range, 1.0, 0), std::invalid_argument);
  EXPECT_THROW(MaxMoveJoint(range, 1.0, -1), std::invalid_argument);
  EXPECT_THROW(MaxMoveJoint(range, 0.0, 1), std::invalid_argument);
  EXPECT_THROW(MaxMoveJoint(range, std::nan(""), 1), std::invalid_argument);
  EXPECT_THROW(MaxMoveJoint(range, 1.0, 1e-12), std::invalid_argument);
}

TEST(MaxMove, OfAJointThatStandsStillIsOneStep) {
  EXPECT_EQ(MaxMoveJoint({"a", 0.5, 0.5, 1, false}, 1.0, 0.1).steps, 1);
}

}  // namespace
}  // namespace silhouette
