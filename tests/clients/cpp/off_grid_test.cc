// SPDX-License-Identifier: Apache-2.0
// What a map tells of any configuration is what the collision test tells, or unknown.
#include "clients/cpp/off_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "server/collision/free_cells.h"
#include "tests/random.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/random_geometry.h"

namespace silhouette {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

client::State Same(State state) {
  if (state == State::kFree) return client::State::kFree;
  return state == State::kOccupied ? client::State::kOccupied : client::State::kUnknown;
}

// The policy as the server tells it.
client::Policy Told(const Policy& policy) {
  client::Policy told{.preset = NameOf(policy.preset), .min_views = policy.min_views};
  if (policy.preset == Preset::kUncalibrated) {
    told.max_occluded_views = policy.max_occluded_views;
  }
  told.off_grid =
      policy.off_grid == OffGrid::kCell ? client::OffGrid::kCell : client::OffGrid::kNearest;
  return told;
}

const ConfigurationGrid& OffGridGrid() {
  static const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 4, .steps = 5},
                                       {.name = "b",
                                        .lower = -std::numbers::pi,
                                        .upper = std::numbers::pi,
                                        .steps = 8,
                                        .continuous = true},
                                       {.name = "c", .lower = -1, .upper = 1, .steps = 3}});
  return grid;
}

RobotImageTable TableWithGaps(const std::vector<MaskSize>& sizes, std::mt19937_64& random) {
  RobotImageTable::Builder builder(OffGridGrid(), sizes);
  for (ConfigurationNumber number = 0; number < OffGridGrid().number_limit(); ++number) {
    if (!OffGridGrid().Contains(number)) continue;
    const auto chance = random() % 60;
    if (chance == 0) continue;
    if (chance == 1) {
      builder.AddWithout(number, RobotImageState::kExcluded);
      continue;
    }
    std::vector<Mask> masks;
    for (const MaskSize size : sizes) masks.push_back(RandomMask(size, 0.08, random));
    builder.Add(number, masks);
  }
  return std::move(builder).Build();
}

// On grid values along some joints, between them along others, at times outside.
Configuration RandomConfiguration(std::mt19937_64& random) {
  std::uniform_real_distribution<double> place(-0.2, 8.2);
  Configuration q;
  for (const GridJoint& joint : OffGridGrid().joints()) {
    const double steps = random() % 2 == 0 ? std::floor(place(random)) : place(random);
    q.push_back(joint.lower +
                std::min<double>(steps, joint.steps - 1 + steps * 0.01) * joint.step());
  }
  return q;
}

struct Counts {
  int free_between = 0;
  int occupied_between = 0;
  int undecided = 0;
};

// As a map tells of them.
auto CellsOf(const FreeCells& cells) {
  return [&cells](ConfigurationNumber number) {
    if (cells.tile(number / kTileSize).Contains(number % kTileSize)) {
      return client::CellState::kFree;
    }
    return cells.exact() ? client::CellState::kOccupied : client::CellState::kUnknown;
  };
}

void ExpectTheServersWordOrUnknown(const CollisionChecker& test,
                                   const std::vector<PixelTree>& trees,
                                   const client::OffGridRule& rule, bool with_cells,
                                   std::mt19937_64& random, Counts& counts) {
  const SpaceChecker space(test, trees);
  FreeCells cells(space, [](uint64_t) { return nullptr; });
  std::vector<uint64_t> tiles(OffGridGrid().tiles());
  std::iota(tiles.begin(), tiles.end(), uint64_t{0});
  ASSERT_TRUE(!with_cells || cells.WorkOut(tiles, [] { return false; }));
  const auto state_at = [&](ConfigurationNumber number) {
    return Same(test.Check(number).state());
  };
  for (int i = 0; i < 60; ++i) {
    const Configuration q = RandomConfiguration(random);
    const client::Verdict verdict =
        with_cells ? client::CheckInMap(OffGridGrid(), rule, q, state_at, CellsOf(cells))
                   : client::CheckInMap(OffGridGrid(), rule, q, state_at, client::kNoCells);
    const Verdict server = test.Check(q);
    const bool between = OffGridGrid().CornersAround(q).count() > 1;
    if (verdict.state != client::State::kUnknown) {
      EXPECT_EQ(verdict.state, Same(server.state()));
      EXPECT_EQ(verdict.reason, client::Reason::kUnspecified);
      if (between) ++(verdict.free() ? counts.free_between : counts.occupied_between);
      continue;
    }
    EXPECT_NE(verdict.reason, client::Reason::kUnspecified);
    EXPECT_EQ(verdict.reason == client::Reason::kOutsideGrid,
              server.reason() == Reason::kOutsideGrid);
    if (verdict.reason == client::Reason::kBetweenGridPoints) {
      ++counts.undecided;
      EXPECT_FALSE(rule.free_corners_suffice);
      // What is between grid points along all joints is decided.
      EXPECT_FALSE(with_cells && cells.exact() &&
                   client::AreWholeCell(OffGridGrid(), OffGridGrid().CornersAround(q)));
    }
    EXPECT_TRUE(between || server.state() == State::kUnknown);
  }
}

TEST(OffGrid, MapSaysWhatTheServerSaysOrUnknown) {
  Random random;
  Counts counts;
  Counts with_cells;
  for (int round = 0; round < 160; ++round) {
    const int views = 1 + round % 4;
    const std::vector<MaskSize> sizes = RandomSizes(views, random);
    const RobotImageTable table = TableWithGaps(sizes, random);
    const EpipolarBands bands(RandomCalibration(views, 0.1, random), sizes, 0.3);
    ObstacleImages images = RandomObstacleImages(sizes, 0.03, random);
    if (round % 8 == 7) images[0].reset();
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated}) {
      for (const OffGrid off_grid : {OffGrid::kCell, OffGrid::kNearest}) {
        Policy policy{.preset = preset, .off_grid = off_grid};
        if (round % 3 != 0) policy.min_views = 1 + static_cast<int>(random() % 2) % views;
        const CollisionChecker test(table, images, policy, {.bands = &bands});
        const client::OffGridRule rule = client::OffGridRuleOf(Told(policy), views);
        ExpectTheServersWordOrUnknown(test, {sizes.begin(), sizes.end()}, rule, false, random,
                                      counts);
        ExpectTheServersWordOrUnknown(test, {sizes.begin(), sizes.end()}, rule, true, random,
                                      with_cells);
      }
    }
  }
  EXPECT_GT(counts.free_between, 100);
  EXPECT_GT(counts.occupied_between, 100);
  EXPECT_GT(counts.undecided, 100);
  EXPECT_GT(with_cells.free_between, counts.free_between + 100);
  EXPECT_LT(with_cells.undecided, counts.undecided);
}

TEST(OffGrid, HowManyViewsMayHideAnObstacleIsNotGuessedWhereARequestNamesThePreset) {
  Random random;
  Counts counts;
  for (int round = 0; round < 400; ++round) {
    const std::vector<MaskSize> sizes = RandomSizes(2, random);
    const RobotImageTable table = TableWithGaps(sizes, random);
    const ObstacleImages images = RandomObstacleImages(sizes, 0.03, random);
    for (const Policy& defaults :
         {Policy{.preset = Preset::kCalibrated, .max_occluded_views = 0},
          Policy{.preset = Preset::kUncalibrated, .min_views = 1, .max_occluded_views = 0}}) {
      // What the server makes of it.
      Policy policy = defaults;
      policy.preset = Preset::kUncalibrated;
      policy.min_views.reset();
      const client::OffGridRule rule = client::OffGridRuleOf(
          client::Effective({.preset = "uncalibrated"}, Told(defaults)), /*views=*/2);
      EXPECT_FALSE(rule.free_corners_suffice);
      const CollisionChecker test(table, images, policy);
      ExpectTheServersWordOrUnknown(test, {sizes.begin(), sizes.end()}, rule, false, random,
                                    counts);
    }
  }
  EXPECT_GT(counts.occupied_between, 100);
  EXPECT_GT(counts.undecided, 100);
}

TEST(OffGrid, FreeCornersSufficeWhereOneViewConvicts) {
  const auto suffice = [](const client::Policy& policy, int views) {
    return client::OffGridRuleOf(policy, views).free_corners_suffice;
  };
  EXPECT_TRUE(suffice({.preset = "uncalibrated", .min_views = 1}, 4));
  EXPECT_TRUE(suffice({.preset = "uncalibrated", .max_occluded_views = 3}, 4));
  EXPECT_TRUE(suffice({.preset = "uncalibrated", .max_occluded_views = 9}, 4));
  EXPECT_TRUE(suffice({.preset = "paper"}, 1));
  EXPECT_TRUE(suffice({.preset = "calibrated", .min_views = 1}, 4));
  EXPECT_TRUE(suffice({.preset = "paper-calibrated", .min_views = 1}, 4));
  EXPECT_FALSE(suffice({.preset = "uncalibrated", .max_occluded_views = 1}, 4));
  EXPECT_FALSE(suffice({.preset = "uncalibrated", .min_views = 2, .max_occluded_views = 3}, 4));
  EXPECT_FALSE(suffice({.preset = "uncalibrated", .min_views = 2}, 4));
  EXPECT_FALSE(suffice({.preset = "paper"}, 4));
  // The robot's model may tell more of a grid point than of a cell.
  EXPECT_FALSE(suffice({.preset = "sound", .min_views = 1}, 4));
  EXPECT_FALSE(suffice({.preset = "sound-planes", .min_views = 1}, 4));
  // What is not known here.
  EXPECT_FALSE(suffice({.preset = "of tomorrow", .min_views = 1}, 4));
  EXPECT_FALSE(suffice({}, 4));
  EXPECT_FALSE(suffice({.preset = "paper"}, 0));
  EXPECT_FALSE(suffice({.preset = "uncalibrated"}, 2));
}

TEST(OffGrid, ReasonsSayWhyAMapIsNotEnough) {
  const auto all = [](client::State state) { return [=](ConfigurationNumber) { return state; }; };
  const client::OffGridRule cell;
  const client::OffGridRule nearest{.off_grid = client::OffGrid::kNearest};
  const Configuration on = OffGridGrid().At(GridIndex{1, 2, 1});
  Configuration off = on;
  off[0] += 0.25;
  const auto reason = [](const client::Verdict& verdict) { return verdict.reason; };
  EXPECT_TRUE(
      client::CheckInMap(OffGridGrid(), cell, on, all(client::State::kFree), client::kNoCells)
          .free());
  EXPECT_TRUE(
      client::CheckInMap(OffGridGrid(), nearest, off, all(client::State::kFree), client::kNoCells)
          .free());
  EXPECT_EQ(reason(client::CheckInMap(OffGridGrid(), cell, off, all(client::State::kFree),
                                      client::kNoCells)),
            client::Reason::kBetweenGridPoints);
  EXPECT_EQ(reason(client::CheckInMap(OffGridGrid(), cell, on, all(client::State::kUnknown),
                                      client::kNoCells)),
            client::Reason::kNotInMap);
  EXPECT_EQ(reason(client::CheckInMap(OffGridGrid(), nearest, off, all(client::State::kUnknown),
                                      client::kNoCells)),
            client::Reason::kNotInMap);
  for (const Configuration& outside : {Configuration{-0.1, 0, 0}, {1, kNaN, 0}, {1, 0}, {}}) {
    for (const client::OffGridRule& rule : {cell, nearest}) {
      const client::Verdict verdict = client::CheckInMap(
          OffGridGrid(), rule, outside, all(client::State::kFree), client::kNoCells);
      EXPECT_EQ(verdict.state, client::State::kUnknown);
      EXPECT_EQ(verdict.reason, client::Reason::kOutsideGrid);
    }
  }
}

TEST(OffGrid, GridPointsOfADrawnRobotSayNothingOfWhatIsInBetween) {
  Configuration q = OffGridGrid().At(GridIndex{1, 2, 1});
  for (const client::OffGrid off_grid : {client::OffGrid::kCell, client::OffGrid::kNearest}) {
    const client::OffGridRule rule{
        .off_grid = off_grid, .free_corners_suffice = true, .drawn = true};
    for (const client::State state : {client::State::kFree, client::State::kOccupied}) {
      const auto all = [state](ConfigurationNumber) { return state; };
      const auto check = [&](double off) {
        Configuration at = q;
        at[0] += off;
        return client::CheckInMap(OffGridGrid(), rule, at, all, client::kNoCells);
      };
      EXPECT_EQ(check(0).state, state);
      EXPECT_EQ(check(0.25).state, client::State::kUnknown);
      EXPECT_EQ(check(0.25).reason, client::Reason::kBetweenGridPoints);
    }
  }
}

TEST(EffectivePolicy, IsWhatTheServerMakesOfARequest) {
  const client::Policy defaults{
      .preset = "calibrated", .min_views = 2, .off_grid = client::OffGrid::kNearest};
  const client::Policy same = client::Effective({}, defaults);
  EXPECT_EQ(same.preset, "calibrated");
  EXPECT_EQ(same.min_views, 2);
  // What the server says of its default preset goes with it.
  const client::Policy other = client::Effective({.preset = "uncalibrated"}, defaults);
  EXPECT_EQ(other.preset, "uncalibrated");
  EXPECT_EQ(other.min_views, std::nullopt);
  EXPECT_EQ(other.off_grid, client::OffGrid::kNearest);
  const client::Policy occluded =
      client::Effective({.max_occluded_views = 2}, {.preset = "uncalibrated", .min_views = 2});
  EXPECT_EQ(occluded.min_views, std::nullopt);
  EXPECT_EQ(occluded.max_occluded_views, 2);
  const client::Policy cell = client::Effective({.off_grid = client::OffGrid::kCell}, defaults);
  EXPECT_EQ(cell.off_grid, client::OffGrid::kCell);
  EXPECT_EQ(cell.min_views, 2);
}

}  // namespace
}  // namespace silhouette
