// SPDX-License-Identifier: Apache-2.0
// A motion is checked in the client as the server's path check does it.
#include "clients/cpp/motion_in_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>
#include <random>
#include <vector>

#include "server/collision/free_cells.h"
#include "tests/random.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/random_geometry.h"

namespace silhouette {
namespace {

const ConfigurationGrid& MotionGrid() {
  static const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 4, .steps = 5},
                                       {.name = "b",
                                        .lower = -std::numbers::pi,
                                        .upper = std::numbers::pi,
                                        .steps = 8,
                                        .continuous = true},
                                       {.name = "c", .lower = -1, .upper = 1, .steps = 3}});
  return grid;
}

RobotImageTable MotionTable(const std::vector<MaskSize>& sizes, bool gaps,
                            std::mt19937_64& random) {
  RobotImageTable::Builder builder(MotionGrid(), sizes);
  for (ConfigurationNumber number = 0; number < MotionGrid().number_limit(); ++number) {
    if (!MotionGrid().Contains(number) || (gaps && random() % 60 == 0)) continue;
    std::vector<Mask> masks;
    for (const MaskSize size : sizes) masks.push_back(RandomMask(size, 0.04, random));
    builder.Add(number, masks);
  }
  return std::move(builder).Build();
}

// As an update of the server makes it.
client::SpaceMap MotionMap(const CollisionChecker& test, const std::vector<PixelTree>& trees,
                           bool with_cells) {
  const SpaceChecker space(test, trees);
  FreeCells cells(space, [](uint64_t) { return nullptr; });
  std::vector<uint64_t> tiles(MotionGrid().tiles());
  std::iota(tiles.begin(), tiles.end(), uint64_t{0});
  EXPECT_TRUE(cells.WorkOut(tiles, [] { return false; }));
  client::SpaceMap map{
      .grid = MotionGrid(), .tiles = {}, .cells_exact = with_cells && cells.exact()};
  for (const uint64_t number : tiles) {
    const std::optional<TileVerdicts> verdicts = test.CheckTile(number, nullptr);
    client::ConfigurationSpaceTile tile;
    tile.tile = number;
    tile.free = verdicts->free;
    tile.occupied = verdicts->occupied;
    if (with_cells) tile.free_cells = cells.tile(number).words;
    client::MakeConsistent(MotionGrid(), tile);
    map.tiles.push_back(std::make_shared<const client::ConfigurationSpaceTile>(tile));
  }
  return map;
}

// Between grid values or, at times, on them, over the rim or about the turn.
Configuration MotionEnd(std::mt19937_64& random) {
  std::uniform_real_distribution<double> place(-0.02, 1.02);
  Configuration q;
  for (const GridJoint& joint : MotionGrid().joints()) {
    const double steps = place(random) * (joint.continuous ? 12 : joint.steps - 1);
    q.push_back(joint.lower + joint.step() * (random() % 8 == 0 ? std::floor(steps) : steps));
  }
  return q;
}

struct MotionCounts {
  int free = 0;
  int occupied = 0;
  int undecided = 0;
};

void ExpectSameMotion(const CollisionChecker& test, const client::SpaceMap& map,
                      const client::OffGridRule& rule, bool decides, std::mt19937_64& random,
                      MotionCounts& counts) {
  const Configuration from = MotionEnd(random);
  Configuration to = MotionEnd(random);
  if (random() % 2 == 0) {
    for (size_t j = 0; j < to.size(); ++j) to[j] = std::lerp(from[j], to[j], 0.3);
  }
  const client::MotionVerdict here = client::CheckMotionInMap(map, rule, from, to);
  const PathVerdict there = test.CheckPath(std::vector{from, to});
  const double end = there.verdict.free() ? 2 : there.segment + there.fraction;
  if (here.free()) {
    ++counts.free;
    EXPECT_TRUE(there.verdict.free());
    EXPECT_EQ(here.checked, there.checked);
    EXPECT_EQ(here.last_free, 1);
    return;
  }
  EXPECT_LE(here.fraction, end);
  EXPECT_LE(here.last_free, here.fraction);
  for (size_t j = 0; j < from.size(); ++j) {
    EXPECT_EQ(here.place[j], std::lerp(from[j], to[j], here.fraction));
  }
  if (here.state == client::State::kOccupied) {
    ++counts.occupied;
    EXPECT_EQ(there.verdict.state(), State::kOccupied);
    EXPECT_EQ(here.fraction, end);
    EXPECT_EQ(here.checked, there.checked);
  } else if (here.reason == client::Reason::kBetweenGridPoints) {
    ++counts.undecided;
    // Only on the rim of cells that are not free is a map that knows its cells at a loss.
    EXPECT_FALSE(decides &&
                 client::AreWholeCell(MotionGrid(), MotionGrid().CornersAround(
                                                        std::span(here.place).first(from.size()))));
  } else {
    EXPECT_EQ(here.fraction, end);
    EXPECT_EQ(there.verdict.state(), State::kUnknown);
  }
}

TEST(MotionInMap, IsFreeOrOccupiedWhereTheServersPathIs) {
  Random random;
  MotionCounts counts;
  for (int round = 0; round < 50; ++round) {
    const int views = 1 + round % 4;
    const std::vector<MaskSize> sizes = RandomSizes(views, random);
    const RobotImageTable table = MotionTable(sizes, round % 4 == 3, random);
    const EpipolarBands bands(RandomCalibration(views, 0.1, random), sizes, 0.3);
    const ObstacleImages images = RandomObstacleImages(sizes, 0.01, random);
    for (const Preset preset :
         {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated, Preset::kPaperCalibrated}) {
      for (const OffGrid off_grid : {OffGrid::kCell, OffGrid::kNearest}) {
        Policy policy{.preset = preset, .off_grid = off_grid};
        if (round % 3 == 0) policy.min_views = 1;
        const CollisionChecker test(table, images, policy, {.bands = &bands});
        client::Policy told{.preset = NameOf(preset), .min_views = policy.min_views};
        told.max_occluded_views = policy.max_occluded_views;
        told.off_grid =
            off_grid == OffGrid::kCell ? client::OffGrid::kCell : client::OffGrid::kNearest;
        const client::OffGridRule rule = client::OffGridRuleOf(told, views);
        const client::SpaceMap map =
            MotionMap(test, {sizes.begin(), sizes.end()}, off_grid == OffGrid::kCell);
        for (int i = 0; i < 250; ++i) {
          ExpectSameMotion(test, map, rule, map.cells_exact, random, counts);
          if (HasFailure()) return;
        }
      }
    }
  }
  EXPECT_GT(counts.free, 5000);
  EXPECT_GT(counts.occupied, 5000);
  EXPECT_LT(counts.undecided, 20'000);
}

TEST(MotionInMap, ForbiddenPlacesAreNotFreeThoughAllGridPointsAroundThemAre) {
  const JointRegions regions({{{.joint = 0, .lower = 1.6, .upper = 1.7}},
                              {{.joint = 1, .continuous = true, .lower = 3, .upper = 3.3},
                               {.joint = 2, .lower = -0.8, .upper = -0.6}}});
  Random random;
  const MaskSize size{8, 8};
  RobotImageTable::Builder builder(MotionGrid(), {size}, 0, regions);
  for (ConfigurationNumber number = 0; number < MotionGrid().number_limit(); ++number) {
    if (MotionGrid().Contains(number)) builder.Add(number, std::vector{Mask(size)});
  }
  const RobotImageTable table = std::move(builder).Build();
  const ObstacleImages images = {ObstacleImage::FromScene(Mask(size), Mask(size))};
  int forbidden = 0;
  int free = 0;
  for (const OffGrid off_grid : {OffGrid::kCell, OffGrid::kNearest}) {
    const CollisionChecker test(table, images, {.min_views = 1, .off_grid = off_grid});
    const client::OffGridRule rule{
        .off_grid = off_grid == OffGrid::kCell ? client::OffGrid::kCell : client::OffGrid::kNearest,
        .free_corners_suffice = true,
        .occupied_corner_suffices = true};
    for (const bool with_cells : {false, true}) {
      const client::SpaceMap map = MotionMap(test, {PixelTree(size)}, with_cells);
      for (int i = 0; i < 500; ++i) {
        const Configuration from = MotionEnd(random);
        const Configuration to = MotionEnd(random);
        const bool here = client::CheckMotionInMap(map, rule, from, from).free();
        if (regions.Between(from, from)) {
          ++forbidden;
          EXPECT_FALSE(here);
        }
        EXPECT_TRUE(!here || test.Check(from).free());
        EXPECT_TRUE(!client::CheckMotionInMap(map, rule, from, to).free() ||
                    test.CheckPath(std::vector{from, to}).verdict.free());
        free += here ? 1 : 0;
      }
    }
  }
  EXPECT_GT(forbidden, 20);
  EXPECT_GT(free, 20);
}

TEST(MotionInMap, MotionThatCannotBeIsNotFree) {
  const client::SpaceMap map{.grid = MotionGrid(), .tiles = {}, .cells_exact = true};
  const Configuration q{1, 0, 0};
  const auto reason = [&](const Configuration& from, const Configuration& to, bool drawn) {
    return client::CheckMotionInMap(map, {.drawn = drawn}, from, to).reason;
  };
  EXPECT_EQ(reason(q, {1, 0}, false), client::Reason::kOutsideGrid);
  EXPECT_EQ(reason({}, q, false), client::Reason::kOutsideGrid);
  EXPECT_EQ(reason({-1, 0, 0}, q, false), client::Reason::kOutsideGrid);
  EXPECT_EQ(reason(q, q, false), client::Reason::kNotInMap);
  EXPECT_EQ(reason(q, q, true), client::Reason::kNotCheckedHere);
}

TEST(MotionInMap, FarTurnsAreNotFree) {
  client::SpaceMap map{.grid = MotionGrid(), .tiles = {}, .cells_exact = false};
  client::ConfigurationSpaceTile tile;
  tile.free.fill(~uint64_t{0});
  tile.free_cells = tile.free;
  client::MakeConsistent(MotionGrid(), tile);
  map.tiles.assign(MotionGrid().tiles(),
                   std::make_shared<const client::ConfigurationSpaceTile>(tile));
  const Configuration q{1, 0, 0};
  EXPECT_TRUE(client::CheckMotionInMap(map, {}, q, Configuration{3.5, 100, 0.5}).free());
  const client::MotionVerdict far = client::CheckMotionInMap(map, {}, q, Configuration{1, 1e12, 0});
  EXPECT_EQ(far.state, client::State::kUnknown);
  EXPECT_EQ(far.reason, client::Reason::kOutsideGrid);
  const Configuration none{1, std::numeric_limits<double>::quiet_NaN(), 0};
  for (const auto& [from, to] : {std::pair{none, q}, std::pair{q, none}}) {
    const client::MotionVerdict motion = client::CheckMotionInMap(map, {}, from, to);
    EXPECT_EQ(motion.reason, client::Reason::kOutsideGrid);
    EXPECT_EQ(motion.last_free, 0) << "nothing of it is known to be free";
  }
}

}  // namespace
}  // namespace silhouette
